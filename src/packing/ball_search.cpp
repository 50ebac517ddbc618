#include "ball_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace ist {
namespace {

// The tree is built anew when it has grown by this share, or where it would become deeper.
constexpr double kGrowth = 0.5;
constexpr std::size_t kDeepest = 64;
// A ball that is as good as the best must not be lost to rounding.
constexpr double kRounding = 1.0 + 1e-12;
// Balls of a leaf at first.
constexpr std::ptrdiff_t kBuiltLeaf = 4;

double box_distance_sq(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p) {
  return (box.min() - p).cwiseMax(p - box.max()).cwiseMax(Eigen::Vector3d::Zero()).squaredNorm();
}

// The corners of a patch. The farthest of them is no nearer to a point than the root of the mean of
// their squared distances, which is that from their middle and their own spread.
struct Corners {
  Corners(const Eigen::Vector3d* first, int size) : corners(first), count(size) {
    middle = corners[0];
    for (int k = 1; k < count; ++k) middle += corners[k];
    middle /= count;
    for (int k = 0; k < count; ++k) spread_sq += (corners[k] - middle).squaredNorm();
    spread_sq *= (1.0 - 1e-9) / count;  // rounding must not make it too large
  }

  // No more than the square of the distance from p to the farthest corner.
  double least_sq(const Eigen::Vector3d& p) const { return (p - middle).squaredNorm() + spread_sq; }

  double farthest_sq(const Eigen::Vector3d& p) const {
    double sq = 0.0;
    for (int k = 0; k < count; ++k) sq = std::max(sq, (corners[k] - p).squaredNorm());
    return sq;
  }

  const Eigen::Vector3d* corners;
  int count;
  Eigen::Vector3d middle;
  double spread_sq = 0.0;
};

}  // namespace

void BallSearch::add(const Eigen::Vector3d& center, double weight) {
  balls_.push_back({center, weight});
  if (static_cast<double>(balls_.size()) > (1.0 + kGrowth) * static_cast<double>(built_)) {
    rebuild();
  } else {
    insert(static_cast<std::uint32_t>(balls_.size() - 1));
  }
}

double BallSearch::apart_sq(const Node& node, const Item& ball) {
  const double weight =
      std::max({node.min_weight - ball.weight, ball.weight - node.max_weight, 0.0});
  return box_distance_sq(node.box, ball.center) + weight * weight;
}

void BallSearch::rebuild() {
  std::vector<std::uint32_t> order(balls_.size());
  std::iota(order.begin(), order.end(), 0U);
  nodes_.clear();
  build(order.data(), order.data() + order.size());
  built_ = balls_.size();
}

std::uint32_t BallSearch::build(std::uint32_t* first, std::uint32_t* last) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(around(first, last));
  if (last - first <= kBuiltLeaf) return index;
  std::uint32_t* const middle = halve(first, last, nodes_[index]);
  const std::uint32_t left = build(first, middle), right = build(middle, last);
  nodes_[index].count = 0;
  nodes_[index].below = {left, right};
  return index;
}

// A leaf if they are few enough, else what an inner node needs but its children.
BallSearch::Node BallSearch::around(const std::uint32_t* first, const std::uint32_t* last) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Node node{{}, kInfinity, -kInfinity, 0, 0, {}};
  for (const std::uint32_t* ball = first; ball != last; ++ball) {
    extend(&node, *ball);
    if (node.count < kLeafSize) node.below[node.count++] = *ball;
  }
  return node;
}

void BallSearch::extend(Node* node, std::uint32_t ball) const {
  node->box.extend(balls_[ball].center);
  node->min_weight = std::min(node->min_weight, balls_[ball].weight);
  node->max_weight = std::max(node->max_weight, balls_[ball].weight);
  node->newest = std::max(node->newest, ball);
}

// By the median of the longest axis. The radius is a fourth: large balls among small ones would
// loosen the bound of all.
std::uint32_t* BallSearch::halve(std::uint32_t* first, std::uint32_t* last,
                                 const Node& node) const {
  Eigen::Index axis;
  const bool by_weight = node.max_weight - node.min_weight > node.box.sizes().maxCoeff(&axis);
  const auto key = [&](std::uint32_t ball) {
    return by_weight ? balls_[ball].weight : balls_[ball].center[axis];
  };
  std::uint32_t* const middle = first + (last - first) / 2;
  std::nth_element(first, middle, last, [&](std::uint32_t a, std::uint32_t b) {
    const double ca = key(a), cb = key(b);
    return ca < cb || (ca == cb && a < b);
  });
  return middle;
}

// Down to the leaf whose balls are most alike; one that is full is halved.
void BallSearch::insert(std::uint32_t ball) {
  std::uint32_t at = 0;
  for (std::size_t depth = 0; nodes_[at].count == 0; ++depth) {
    if (depth + 1 == kDeepest) return rebuild();
    extend(&nodes_[at], ball);
    const std::uint32_t left = nodes_[at].below[0], right = nodes_[at].below[1];
    at =
        apart_sq(nodes_[right], balls_[ball]) < apart_sq(nodes_[left], balls_[ball]) ? right : left;
  }
  extend(&nodes_[at], ball);
  if (nodes_[at].count < kLeafSize) {
    nodes_[at].below[nodes_[at].count++] = ball;
    return;
  }
  std::array<std::uint32_t, kLeafSize + 1> balls;
  std::copy(nodes_[at].below.begin(), nodes_[at].below.end(), balls.begin());
  balls.back() = ball;
  std::uint32_t* const last = balls.data() + balls.size();
  std::uint32_t* const middle = halve(balls.data(), last, nodes_[at]);
  const auto left = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(around(balls.data(), middle));
  nodes_.push_back(around(middle, last));
  nodes_[at].count = 0;
  nodes_[at].below = {left, left + 1};
}

BallSearch::Match BallSearch::best(const Eigen::Vector3d* corners, int corner_count,
                                   std::uint32_t hint, std::size_t seen, double enough) const {
  const Corners patch(corners, corner_count);
  Match match{hint, std::sqrt(patch.farthest_sq(balls_[hint].center)) - balls_[hint].weight};
  if (match.cost <= enough || nodes_[0].newest < seen) return match;
  // Of a ball below a node: from its centre to the farthest corner, less its radius.
  const auto bound = [&](const Node& node) {
    return std::sqrt(box_distance_sq(node.box, patch.middle) + patch.spread_sq) - node.max_weight;
  };
  struct Entry {
    std::uint32_t node;
    double bound;
  };
  std::array<Entry, kDeepest + 2> stack;
  std::size_t top = 0;
  stack[top++] = {0, bound(nodes_[0])};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.bound > match.cost) continue;
    const Node& node = nodes_[entry.node];
    for (std::uint32_t i = 0; i < node.count; ++i) {
      const std::uint32_t ball = node.below[i];
      const Item& item = balls_[ball];
      const double reach = match.cost + item.weight;
      if (reach < 0.0 || patch.least_sq(item.center) > kRounding * reach * reach) continue;
      const double cost = std::sqrt(patch.farthest_sq(item.center)) - item.weight;
      if (cost < match.cost || (cost == match.cost && ball < match.ball)) match = {ball, cost};
    }
    if (match.cost <= enough) break;
    if (node.count > 0) continue;
    Entry near{node.below[0], bound(nodes_[node.below[0]])};
    Entry far{node.below[1], bound(nodes_[node.below[1]])};
    if (far.bound < near.bound) std::swap(near, far);
    if (far.bound <= match.cost && nodes_[far.node].newest >= seen) stack[top++] = far;
    if (near.bound <= match.cost && nodes_[near.node].newest >= seen) stack[top++] = near;
  }
  return match;
}

}  // namespace ist
