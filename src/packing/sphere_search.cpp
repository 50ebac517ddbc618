#include "sphere_search.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// The BVH is rebuilt when it has grown by this share, or where an insertion would make it deeper.
constexpr double kGrowth = 0.5;
constexpr std::size_t kMaxLevels = 64;
// Rounding must not prune a sphere that is as good as the best one.
constexpr double kAsGood = 1.0 + 1e-12;
// Spheres of a leaf after a rebuild; insertions fill it up.
constexpr std::ptrdiff_t kBuiltLeaf = 4;

double box_distance_sq(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p) {
  return (box.min() - p).cwiseMax(p - box.max()).cwiseMax(Eigen::Vector3d::Zero()).squaredNorm();
}

}  // namespace

// The largest squared distance from a point to the corners is at least the mean one, which is the
// squared distance to the corners' mean plus their variance.
class SphereSearch::PatchCorners {
 public:
  PatchCorners(const Eigen::Vector3d* corners, int count) : corners_(corners), count_(count) {
    mean_ = corners_[0];
    for (int k = 1; k < count_; ++k) mean_ += corners_[k];
    mean_ /= count_;
    for (int k = 0; k < count_; ++k) variance_ += (corners_[k] - mean_).squaredNorm();
    variance_ *= (1.0 - 1e-9) / count_;  // rounding must not make it too large
  }

  double cost(const WeightedCenter& sphere) const {
    return std::sqrt(max_distance_sq(sphere.center)) - sphere.weight;
  }

  // Lower bound of the cost of all spheres in the node's subtree.
  double lower_bound(const Node& node) const {
    return std::sqrt(box_distance_sq(node.box, mean_) + variance_) - node.max_weight;
  }

  // Whether the sphere certainly costs more than `cost`, found without a square root.
  bool is_costlier(const WeightedCenter& sphere, double cost) const {
    const double max_distance = cost + sphere.weight;
    return max_distance < 0.0 || (sphere.center - mean_).squaredNorm() + variance_ >
                                     kAsGood * max_distance * max_distance;
  }

 private:
  double max_distance_sq(const Eigen::Vector3d& p) const {
    double sq = 0.0;
    for (int k = 0; k < count_; ++k) sq = std::max(sq, (corners_[k] - p).squaredNorm());
    return sq;
  }

  const Eigen::Vector3d* corners_;
  int count_;
  Eigen::Vector3d mean_;
  double variance_ = 0.0;  // [m^2]
};

void SphereSearch::add(const Eigen::Vector3d& center, double weight) {
  spheres_.push_back({center, weight});
  if (static_cast<double>(spheres_.size()) > (1.0 + kGrowth) * static_cast<double>(built_)) {
    rebuild();
  } else {
    insert(static_cast<std::uint32_t>(spheres_.size() - 1));
  }
}

// The squared distance from the sphere's (center, weight) in four dimensions to the node's box.
double SphereSearch::distance_sq(const Node& node, const WeightedCenter& sphere) {
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
  nodes_.push_back(make_node(first, last));
  if (last - first <= kBuiltLeaf) return index;
  std::uint32_t* const middle = split_at_median(first, last, nodes_[index]);
  const std::uint32_t left = build(first, middle), right = build(middle, last);
  nodes_[index].count = 0;
  nodes_[index].children = {left, right};
  return index;
}

// Makes a leaf if they are few enough, else an inner node without its children.
SphereSearch::Node SphereSearch::make_node(const std::uint32_t* first,
                                           const std::uint32_t* last) const {
  Node node{{}, kInfinity, -kInfinity, 0, 0, {}};
  for (const std::uint32_t* sphere = first; sphere != last; ++sphere) {
    extend(&node, *sphere);
    if (node.count < kLeafSize) node.children[node.count++] = *sphere;
  }
  return node;
}

void SphereSearch::extend(Node* node, std::uint32_t sphere) const {
  node->box.extend(spheres_[sphere].center);
  node->min_weight = std::min(node->min_weight, spheres_[sphere].weight);
  node->max_weight = std::max(node->max_weight, spheres_[sphere].weight);
  node->newest = std::max(node->newest, sphere);
}

// Splits at the median of the longest axis. The weight is a fourth axis: a large sphere among small
// ones would loosen the lower bound of all.
std::uint32_t* SphereSearch::split_at_median(std::uint32_t* first, std::uint32_t* last,
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

// Descends to the leaf whose spheres are most alike; a full leaf is split.
void SphereSearch::insert(std::uint32_t sphere) {
  std::uint32_t at = 0;
  for (std::size_t depth = 0; nodes_[at].count == 0; ++depth) {
    if (depth + 1 == kMaxLevels) return rebuild();
    extend(&nodes_[at], sphere);
    const std::uint32_t left = nodes_[at].children[0], right = nodes_[at].children[1];
    at = distance_sq(nodes_[right], spheres_[sphere]) < distance_sq(nodes_[left], spheres_[sphere])
             ? right
             : left;
  }
  extend(&nodes_[at], sphere);
  if (nodes_[at].count < kLeafSize) {
    nodes_[at].children[nodes_[at].count++] = sphere;
  } else {
    split_leaf(at, sphere);
  }
}

void SphereSearch::split_leaf(std::uint32_t leaf, std::uint32_t added) {
  std::array<std::uint32_t, kLeafSize + 1> spheres;
  std::copy(nodes_[leaf].children.begin(), nodes_[leaf].children.end(), spheres.begin());
  spheres.back() = added;
  std::uint32_t* const last = spheres.data() + spheres.size();
  std::uint32_t* const middle = split_at_median(spheres.data(), last, nodes_[leaf]);
  const auto left = static_cast<std::uint32_t>(nodes_.size());
  nodes_.push_back(make_node(spheres.data(), middle));
  nodes_.push_back(make_node(middle, last));
  nodes_[leaf].count = 0;
  nodes_[leaf].children = {left, left + 1};
}

void SphereSearch::search_leaf(const Node& leaf, const PatchCorners& patch, Match* match) const {
  for (std::uint32_t i = 0; i < leaf.count; ++i) {
    const std::uint32_t sphere = leaf.children[i];
    if (patch.is_costlier(spheres_[sphere], match->cost)) continue;
    const double cost = patch.cost(spheres_[sphere]);
    const bool is_better = cost < match->cost || (cost == match->cost && sphere < match->sphere);
    if (is_better) *match = {sphere, cost};
  }
}

// Branch and bound, depth first: of two children the one with the lower bound comes first.
SphereSearch::Match SphereSearch::best(const Eigen::Vector3d* corners, int corner_count,
                                       std::uint32_t hint, std::size_t first, double enough) const {
  struct Entry {
    std::uint32_t node;
    double lower_bound;
  };
  const PatchCorners patch(corners, corner_count);
  Match match{hint, patch.cost(spheres_[hint])};
  if (match.cost <= enough || nodes_[0].newest < first) return match;
  TraversalStack<Entry, stack_capacity(kMaxLevels, 2)> stack;
  stack.push({0, patch.lower_bound(nodes_[0])});
  while (!stack.empty()) {
    const Entry entry = stack.pop();
    if (entry.lower_bound > match.cost) continue;
    const Node& node = nodes_[entry.node];
    if (node.count > 0) {
      search_leaf(node, patch, &match);
      if (match.cost <= enough) break;
      continue;
    }
    const std::size_t siblings = stack.size();
    for (const std::uint32_t child : {node.children[1], node.children[0]}) {
      const double lower_bound = patch.lower_bound(nodes_[child]);
      if (lower_bound > match.cost || nodes_[child].newest < first) continue;
      stack.push_least_on_top<&Entry::lower_bound>(siblings, {child, lower_bound});
    }
  }
  return match;
}

}  // namespace ist
