#include "ball_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

namespace ist {
namespace {

constexpr std::uint32_t kLeafSize = 4;
constexpr std::size_t kMinBuffer = 32;

double cost_of(const Eigen::Vector3d& center, double weight, const Eigen::Vector3d* corners,
               int corner_count) {
  double farthest_sq = 0.0;
  for (int k = 0; k < corner_count; ++k) {
    farthest_sq = std::max(farthest_sq, (corners[k] - center).squaredNorm());
  }
  return std::sqrt(farthest_sq) - weight;
}

double box_distance_sq(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p) {
  return (box.min() - p).cwiseMax(p - box.max()).cwiseMax(Eigen::Vector3d::Zero()).squaredNorm();
}

}  // namespace

void BallSearch::add(const Eigen::Vector3d& center, double weight) {
  balls_.push_back({center, weight});
  if (balls_.size() - in_tree_ > kMinBuffer + in_tree_ / 32) rebuild();
}

void BallSearch::rebuild() {
  order_.resize(balls_.size());
  std::iota(order_.begin(), order_.end(), 0U);
  nodes_.clear();
  nodes_.reserve(balls_.size());
  build(0, static_cast<std::uint32_t>(balls_.size()));
  in_tree_ = balls_.size();
}

std::uint32_t BallSearch::build(std::uint32_t first, std::uint32_t last) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Eigen::AlignedBox3d box;
  std::uint32_t newest = 0;
  double max_weight = 0.0, min_weight = std::numeric_limits<double>::infinity();
  for (std::uint32_t i = first; i < last; ++i) {
    box.extend(balls_[order_[i]].center);
    newest = std::max(newest, order_[i]);
    max_weight = std::max(max_weight, balls_[order_[i]].weight);
    min_weight = std::min(min_weight, balls_[order_[i]].weight);
  }
  nodes_[index] = {box, max_weight, first, last - first, newest};
  if (last - first <= kLeafSize) return index;
  // The radius is a fourth axis: large balls among small ones would loosen the bound of all.
  Eigen::Index axis;
  const bool by_weight = max_weight - min_weight > box.sizes().maxCoeff(&axis);
  const auto key = [&](std::uint32_t ball) {
    return by_weight ? balls_[ball].weight : balls_[ball].center[axis];
  };
  const std::uint32_t middle = first + (last - first) / 2;
  std::nth_element(order_.begin() + first, order_.begin() + middle, order_.begin() + last,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double ca = key(a), cb = key(b);
                     return ca < cb || (ca == cb && a < b);
                   });
  build(first, middle);
  const std::uint32_t right = build(middle, last);
  nodes_[index].first = right;
  nodes_[index].count = 0;
  return index;
}

BallSearch::Match BallSearch::best(const Eigen::Vector3d* corners, int corner_count,
                                   std::uint32_t hint, std::size_t seen) const {
  Match match{hint, cost_of(balls_[hint].center, balls_[hint].weight, corners, corner_count)};
  const auto consider = [&](std::uint32_t ball) {
    const double cost = cost_of(balls_[ball].center, balls_[ball].weight, corners, corner_count);
    if (cost < match.cost || (cost == match.cost && ball < match.ball)) match = {ball, cost};
  };
  for (std::size_t i = std::max(in_tree_, seen); i < balls_.size(); ++i)
    consider(static_cast<std::uint32_t>(i));
  if (nodes_.empty() || seen >= in_tree_) return match;

  // A ball below a node is at least as far from the farthest corner as the node's box is.
  const auto bound = [&](const Node& node) {
    double farthest_sq = 0.0;
    for (int k = 0; k < corner_count; ++k) {
      farthest_sq = std::max(farthest_sq, box_distance_sq(node.box, corners[k]));
    }
    return std::sqrt(farthest_sq) - node.max_weight;
  };
  struct Entry {
    std::uint32_t node;
    double bound;
  };
  std::array<Entry, 64> stack;
  std::size_t top = 0;
  stack[top++] = {0, bound(nodes_[0])};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.bound > match.cost) continue;
    const Node& node = nodes_[entry.node];
    if (node.count > 0) {
      for (std::uint32_t i = node.first; i < node.first + node.count; ++i) consider(order_[i]);
      continue;
    }
    Entry near{entry.node + 1, bound(nodes_[entry.node + 1])};
    Entry far{node.first, bound(nodes_[node.first])};
    if (far.bound < near.bound) std::swap(near, far);
    if (far.bound <= match.cost && nodes_[far.node].newest >= seen) stack[top++] = far;
    if (near.bound <= match.cost && nodes_[near.node].newest >= seen) stack[top++] = near;
  }
  return match;
}

}  // namespace ist
