#include "sphere_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace ist {
namespace {

// The tree is built anew when it has grown by this share, or where it would become deeper.
constexpr double kGrowth = 0.5;
constexpr std::size_t kDeepest = 64;
// A sphere that is as good as the best must not be lost to rounding.
constexpr double kRounding = 1.0 + 1e-12;
// Spheres of a leaf at first.
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

void SphereSearch::add(const Eigen::Vector3d& center, double weight) {
  spheres_.push_back({center, weight});
  if (static_cast<double>(spheres_.size()) > (1.0 + kGrowth) * static_cast<double>(built_)) {
    rebuild();
  } else {
    insert(static_cast<std::uint32_t>(spheres_.size() - 1));
  }
}

double SphereSearch::apart_sq(const Node& node, const Item& sphere) {
  const double weight =
      std::max({node.min_weight - sphere.weight, sphere.weight - node.max_weight, 0.0});
  return box_distance_sq(node.box, sphere.center) + weight * weight;
}

void SphereSearch::rebuild() {
  std::vector<std::uint32_t> order(spheres_.size());
  std::iota(order.begin(), order.end(), 0U);
  nodes_.clear();
  build(order.data(), order.data() + order.size());
  built_ = spheres_.size();
}

std::uint32_t SphereSearch::build(std::uint32_t* first, std::uint32_t* last) {
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
SphereSearch::Node SphereSearch::around(const std::uint32_t* first,
                                        const std::uint32_t* last) const {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Node node{{}, kInfinity, -kInfinity, 0, 0, {}};
  for (const std::uint32_t* sphere = first; sphere != last; ++sphere) {
    extend(&node, *sphere);
    if (node.count < kLeafSize) node.below[node.count++] = *sphere;
  }
  return node;
}

void SphereSearch::extend(Node* node, std::uint32_t sphere) const {
  node->box.extend(spheres_[sphere].center);
  node->min_weight = std::min(node->min_weight, spheres_[sphere].weight);
  node->max_weight = std::max(node->max_weight, spheres_[sphere].weight);
  node->newest = std::max(node->newest, sphere);
}

// By the median of the longest axis. The radius is a fourth: large spheres among small ones would
// loosen the bound of all.
std::uint32_t* SphereSearch::halve(std::uint32_t* first, std::uint32_t* last,
                                   const Node& node) const {
  Eigen::Index axis;
  const bool by_weight = node.max_weight - node.min_weight > node.box.sizes().maxCoeff(&axis);
  const auto key = [&](std::uint32_t sphere) {
    return by_weight ? spheres_[sphere].weight : spheres_[sphere].center[axis];
  };
  std::uint32_t* const middle = first + (last - first) / 2;
  std::nth_element(first, middle, last, [&](std::uint32_t a, std::uint32_t b) {
    const double ca = key(a), cb = key(b);
    return ca < cb || (ca == cb && a < b);
  });
  return middle;
}

// Down to the leaf whose spheres are most alike; one that is full is halved.
void SphereSearch::insert(std::uint32_t sphere) {
  std::uint32_t at = 0;
  for (std::size_t depth = 0; nodes_[at].count == 0; ++depth) {
    if (depth + 1 == kDeepest) return rebuild();
    extend(&nodes_[at], sphere);
    const std::uint32_t left = nodes_[at].below[0], right = nodes_[at].below[1];
    at = apart_sq(nodes_[right], spheres_[sphere]) < apart_sq(nodes_[left], spheres_[sphere])
             ? right
             : left;
  }
  extend(&nodes_[at], sphere);
  if (nodes_[at].count < kLeafSize) {
    nodes_[at].below[nodes_[at].count++] = sphere;
    return;
  }
  std::array<std::uint32_t, kLeafSize + 1> spheres;
  std::copy(nodes_[at].below.begin(), nodes_[at].below.end(), spheres.begin());
  spheres.back() = sphere;
  std::uint32_t* const last = spheres.data() + spheres.size();
  std::uint32_t* const middle = halve(spheres.data(), last, nodes_[at]);
  const auto left = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(around(spheres.data(), middle));
  nodes_.push_back(around(middle, last));
  nodes_[at].count = 0;
  nodes_[at].below = {left, left + 1};
}

SphereSearch::Match SphereSearch::best(const Eigen::Vector3d* corners, int corner_count,
                                       std::uint32_t hint, std::size_t seen, double enough) const {
  const Corners patch(corners, corner_count);
  Match match{hint, std::sqrt(patch.farthest_sq(spheres_[hint].center)) - spheres_[hint].weight};
  if (match.cost <= enough || nodes_[0].newest < seen) return match;
  // Of a sphere below a node: from its centre to the farthest corner, less its radius.
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
      const std::uint32_t sphere = node.below[i];
      const Item& item = spheres_[sphere];
      const double reach = match.cost + item.weight;
      if (reach < 0.0 || patch.least_sq(item.center) > kRounding * reach * reach) continue;
      const double cost = std::sqrt(patch.farthest_sq(item.center)) - item.weight;
      if (cost < match.cost || (cost == match.cost && sphere < match.sphere))
        match = {sphere, cost};
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
