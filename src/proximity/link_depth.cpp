// The part of a link's query that looks for points inside the link.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "internal/cloud/bounding_sphere.h"
#include "proximity/link_query.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Entry {
  double bound;  ///< [m] no point below has a smaller signed distance
  std::int32_t child;
};

}  // namespace

// Culling by unsigned distance fails inside, where the deepest point is wanted. The signed distance
// falls by no more than the way between two points (but for holes, see PointDepth), so what a grid
// knows near a box's middle bounds all of the box: branch and bound over the boxes that may hold
// points inside.
void LinkQuery::find_depth(Deadline* deadline) {
  std::array<Entry, 512> stack;  // 16 children on each of at most 8 levels, and room
  std::size_t top = 0;
  stack[top++] = {-kInfinity, index_->root()};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.bound >= threshold()) {
      drop(entry.bound);
      continue;
    }
    if (deadline->passed()) {
      drop(-link_->tree.radius());
      return;
    }
    if (entry.child < 0) {
      find_depth_in_tile(~entry.child, entry.bound);
      continue;
    }
    const BoxNode& node = index_->nodes()[static_cast<std::size_t>(entry.child)];
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      const BoundingSphere sphere = bounding_sphere(node, k);
      const double bound = depth_bound(X_LO_ * sphere.center, sphere.radius);
      if (bound == kInfinity) continue;
      if (bound >= threshold()) {
        drop(bound);
        continue;
      }
      std::size_t at = top++;  // the deepest on top
      for (; at > begin && stack[at - 1].bound < bound; --at) stack[at] = stack[at - 1];
      stack[at] = {bound, node.child[k]};
    }
  }
}

// [m] No point of a sphere has a smaller signed distance; inf: what it holds the descent has seen,
// all of it outside. Cells are measured only where spheres of the link are near.
double LinkQuery::depth_bound(const Eigen::Vector3d& center, double radius) {
  DepthGrid::Found found;
  const bool is_known = grid_.look(center, &found);
  if (is_known) {
    const double bound = found.floor - radius - kRounding;
    if (bound >= threshold()) return bound;
  }
  if (link_->tree.cover_distance_exceeds(center, interior_reach() + radius)) return kInfinity;
  if (!is_known) {
    ++statistics_->exact_evaluations;
    found = grid_.measure(center);
  }
  return found.floor - radius - kRounding;
}

// Each point that is evaluated bounds its neighbours too, so few of the sixteen have to be.
void LinkQuery::find_depth_in_tile(std::int32_t tile, double tile_bound) {
  const double interior = interior_reach();
  const std::uint64_t index = index_->build_id();
  PointTile room;
  const PointTile& points = index_->tile(static_cast<std::size_t>(tile), &room);
  const int count = points.count;
  std::array<Eigen::Vector3d, kPointWidth> p_L;
  std::array<double, kPointWidth> bound;
  std::array<bool, kPointWidth> open;
  for (int k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    p_L[i] = X_LO_ * points.point(k);
    bound[i] = tile_bound;
    DepthGrid::Found found;
    if (grid_.look(p_L[i], &found)) bound[i] = std::max(bound[i], found.floor);
    open[i] = true;
  }
  const auto bound_all = [&](int from, double floor) {
    const auto i = static_cast<std::size_t>(from);
    for (std::size_t j = 0; j < static_cast<std::size_t>(count); ++j) {
      bound[j] = std::max(bound[j], floor - (p_L[j] - p_L[i]).norm());
    }
  };
  for (int k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    if (bound[i] >= threshold()) continue;
    const double known = known_.at(index, KnownDistances::Kind::kPoint, key_of(tile, k), p_L[i]);
    if (known > bound[i]) bound_all(k, known);
  }
  for (int round = 0; round < count; ++round) {
    int next = -1;
    for (int k = 0; k < count; ++k) {
      const auto i = static_cast<std::size_t>(k);
      if (open[i] && (next < 0 || bound[i] < bound[static_cast<std::size_t>(next)])) next = k;
    }
    const auto i = static_cast<std::size_t>(next);
    if (bound[i] >= threshold()) {
      drop(bound[i]);  // the smallest of those that are left
      return;
    }
    open[i] = false;
    if (link_->tree.cover_distance_exceeds(p_L[i], interior)) continue;
    ++statistics_->exact_evaluations;
    DepthGrid::Found found;
    grid_.look(p_L[i], &found);
    const PointDepth depth = point_depth(link_->solid, p_L[i], -threshold(), found.near);
    known_.keep(index, KnownDistances::Kind::kPoint, key_of(tile, next), p_L[i], depth.floor);
    if (depth.exact.distance < kInfinity) {
      take(depth.exact, p_L[i], point_O(tile, next), tile, next);
    } else {
      drop(std::max(depth.floor, threshold()));
    }
    bound_all(next, depth.floor);
  }
}

}  // namespace ist
