#include "ist_proximity/tree/inner_sphere_tree.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>
#include <numeric>

#include "internal/geometry/float_rounding.h"
#include "tree/beyond_kernel.h"
#include "tree/partition.h"

namespace ist {
namespace {

// Slots without a child: at the origin, with a radius that makes them farther than anything.
constexpr float kNoRadius = -1e30F;
constexpr int kEnclosingSteps = 48;

// Not to be inlined: where it meets the way back to double, GCC 12 (-O2) vectorizes the pair into
// nothing, and the rounding is not there any more.
[[gnu::noinline]] Eigen::Vector3f to_float(const Eigen::Vector3d& p) { return p.cast<float>(); }

struct Enclosing {
  Eigen::Vector3f center;
  double radius;
};

// The sphere in float: its inner sphere lies in the given one, its cover sphere about it.
InnerSphere rounded(const InnerSphere& sphere) {
  const Eigen::Vector3d center = to_float(sphere.center).cast<double>();
  const double moved = (center - sphere.center).norm();
  return {center, round_down(sphere.radius - moved), round_up(sphere.cover_radius + moved)};
}

class Builder {
 public:
  Builder(const std::vector<InnerSphere>& spheres, const TreeConfig& config,
          std::vector<SphereNode>* nodes, std::vector<SphereLeaf>* leaves)
      : config_(config),
        nodes_(*nodes),
        leaves_(*leaves),
        spheres_(spheres.size()),
        order_{&spheres_, std::vector<std::uint32_t>(spheres.size())} {
    std::transform(spheres.begin(), spheres.end(), spheres_.begin(), rounded);
    std::iota(order_.indices.begin(), order_.indices.end(), 0U);
  }
  Builder(const Builder&) = delete;
  Builder& operator=(const Builder&) = delete;

  // The root is always a node, so that a query starts the same way for every link.
  void run() { add_node(all(), kMaxTreeLevels - 1); }

  Enclosing enclose(const SphereRange& range) const;
  SphereRange all() const { return {0, static_cast<std::uint32_t>(order_.indices.size())}; }

 private:
  static bool is_leaf(const SphereRange& range) {
    return size(range) <= static_cast<std::uint32_t>(kSphereWidth);
  }
  std::int32_t add_node(const SphereRange& range, int levels_left);
  std::int32_t add_leaf(const SphereRange& range);

  const TreeConfig config_;
  std::vector<SphereNode>& nodes_;
  std::vector<SphereLeaf>& leaves_;
  std::vector<InnerSphere> spheres_;  // rounded: what the leaves hold is what the nodes enclose
  SphereOrder order_;
};

// A small sphere about the cover spheres: start at the box's middle and step toward the farthest
// sphere with ever shorter steps (Badoiu and Clarkson 2003), then measure the radius in full.
Enclosing Builder::enclose(const SphereRange& range) const {
  Eigen::AlignedBox3d box;
  for (std::uint32_t i = range.first; i < range.second; ++i) {
    const InnerSphere& sphere = order_[i];
    box.extend(Eigen::Vector3d(sphere.center.array() - sphere.cover_radius));
    box.extend(Eigen::Vector3d(sphere.center.array() + sphere.cover_radius));
  }
  const auto farthest = [&](const Eigen::Vector3d& center, const InnerSphere** sphere) {
    double largest = -1.0;
    for (std::uint32_t i = range.first; i < range.second; ++i) {
      const InnerSphere& candidate = order_[i];
      const double reach = (candidate.center - center).norm() + candidate.cover_radius;
      if (reach > largest) {
        largest = reach;
        *sphere = &candidate;
      }
    }
    return largest;
  };
  const InnerSphere* sphere = nullptr;
  Eigen::Vector3d center = box.center(), best = center;
  double smallest = farthest(center, &sphere);
  for (int step = 1; step <= kEnclosingSteps && size(range) > 1; ++step) {
    const Eigen::Vector3d to_sphere = sphere->center - center;
    const double distance = to_sphere.norm();
    const double reach = distance + sphere->cover_radius;
    if (distance > 0.0) center += to_sphere / distance * (0.5 * reach / (step + 1));
    const double radius = farthest(center, &sphere);
    if (radius < smallest) {
      smallest = radius;
      best = center;
    }
  }
  const Eigen::Vector3f rounded = to_float(best);
  return {rounded, farthest(rounded.cast<double>(), &sphere)};
}

std::int32_t Builder::add_node(const SphereRange& range, int levels_left) {
  const auto index = static_cast<std::int32_t>(nodes_.size());
  nodes_.emplace_back();
  const std::vector<SphereRange> groups = is_leaf(range)
                                              ? std::vector<SphereRange>{range}
                                              : partition(config_, range, levels_left, &order_);
  SphereNode node{};
  node.count = static_cast<std::int32_t>(groups.size());
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); ++k) {
    node.radius[k] = node.max_inner[k] = kNoRadius;
    if (k >= groups.size()) continue;
    const Enclosing sphere = enclose(groups[k]);
    node.x[k] = sphere.center.x();
    node.y[k] = sphere.center.y();
    node.z[k] = sphere.center.z();
    node.radius[k] = round_up(sphere.radius);
    for (std::uint32_t i = groups[k].first; i < groups[k].second; ++i) {
      node.max_inner[k] = std::max(node.max_inner[k], round_up(order_[i].radius));
    }
    node.child[k] =
        is_leaf(groups[k]) ? ~add_leaf(groups[k]) : add_node(groups[k], levels_left - 1);
  }
  nodes_[static_cast<std::size_t>(index)] = node;
  return index;
}

std::int32_t Builder::add_leaf(const SphereRange& range) {
  SphereLeaf leaf{};
  leaf.count = static_cast<std::int32_t>(size(range));
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(kSphereWidth); ++k) {
    leaf.inner_radius[k] = leaf.cover_radius[k] = kNoRadius;
    if (range.first + k >= range.second) continue;
    const InnerSphere& sphere = order_[range.first + k];
    leaf.x[k] = static_cast<float>(sphere.center.x());
    leaf.y[k] = static_cast<float>(sphere.center.y());
    leaf.z[k] = static_cast<float>(sphere.center.z());
    leaf.inner_radius[k] = static_cast<float>(sphere.radius);
    leaf.cover_radius[k] = static_cast<float>(sphere.cover_radius);
  }
  leaves_.push_back(leaf);
  return static_cast<std::int32_t>(leaves_.size()) - 1;
}

}  // namespace

InnerSphereTree::InnerSphereTree(const Packing& packing, const TreeConfig& config)
    : interior_gap_(packing.certificate.interior_gap), sphere_count_(packing.spheres.size()) {
  assert(config.magnification >= 0.0 && config.magnification <= 1.0);
  if (packing.spheres.empty()) return;
  Builder builder(packing.spheres, config, &nodes_, &leaves_);
  const Enclosing all = builder.enclose(builder.all());
  center_ = all.center.cast<double>();
  radius_ = round_up(all.radius);
  builder.run();
}

double InnerSphereTree::inner_distance(const Eigen::Vector3d& p_L) const {
  double nearest = std::numeric_limits<double>::infinity();
  for (const SphereLeaf& leaf : leaves_) {
    for (int k = 0; k < leaf.count; ++k) {
      const Eigen::Vector3d center(leaf.x[k], leaf.y[k], leaf.z[k]);
      nearest =
          std::min(nearest, (p_L - center).norm() - static_cast<double>(leaf.inner_radius[k]));
    }
  }
  return nearest;
}

double InnerSphereTree::cover_distance(const Eigen::Vector3d& p_L, double stop_below) const {
  double nearest = std::numeric_limits<double>::infinity();
  if (nodes_.empty()) return nearest;
  const Eigen::Vector3f p = p_L.cast<float>();
  // Rounding of p, of the differences and of the root, in units of the numbers involved.
  const double rounding = 1e-6 * (p_L.cwiseAbs().maxCoeff() + radius_ + center_.norm());
  struct Entry {
    std::int32_t child;
    float bound;
  };
  std::array<Entry, kSphereWidth * kMaxTreeLevels> stack;
  std::size_t top = 0;
  stack[top++] = {0, -std::numeric_limits<float>::max()};
  std::array<float, kSphereWidth> distance{};
  const auto distances = [&p, &distance](const float* x, const float* y, const float* z,
                                         const float* radius) {
    for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); ++k) {
      const float dx = x[k] - p.x(), dy = y[k] - p.y(), dz = z[k] - p.z();
      distance[k] = std::sqrt(dx * dx + dy * dy + dz * dz) - radius[k];
    }
  };
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.bound >= nearest) continue;
    if (entry.child < 0) {
      const SphereLeaf& leaf = leaves_[static_cast<std::size_t>(~entry.child)];
      distances(leaf.x, leaf.y, leaf.z, leaf.cover_radius);
      for (const float d : distance) nearest = std::min(nearest, static_cast<double>(d));
      if (nearest - rounding < stop_below) break;
      continue;
    }
    const SphereNode& node = nodes_[static_cast<std::size_t>(entry.child)];
    distances(node.x, node.y, node.z, node.radius);
    const std::size_t begin = top;
    for (std::size_t k = 0; k < static_cast<std::size_t>(node.count); ++k) {
      if (distance[k] >= nearest) continue;
      std::size_t at = top++;  // nearest child on top
      for (; at > begin && stack[at - 1].bound < distance[k]; --at) stack[at] = stack[at - 1];
      stack[at] = {node.child[k], distance[k]};
    }
  }
  return nearest - rounding;
}

bool InnerSphereTree::cover_distance_exceeds(const Eigen::Vector3d& p_L, double distance) const {
  if (nodes_.empty()) return true;
  const Eigen::Vector3f p = p_L.cast<float>();
  // As in cover_distance.
  const double rounding = 1e-6 * (p_L.cwiseAbs().maxCoeff() + radius_ + center_.norm());
  return cover_distance_exceeds_spheres(nodes_.data(), leaves_.data(), p.data(),
                                        static_cast<float>(distance + rounding));
}

}  // namespace ist
