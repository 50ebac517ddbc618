// The part of a link's query that looks for points inside the link.

#include <algorithm>
#include <array>
#include <cmath>

#include "proximity/link_query.h"

namespace ist {
namespace {

struct Entry {
  double bound;  ///< [m] no point below has a smaller signed distance
  std::int32_t child;
};

struct Ball3d {
  Eigen::Vector3d center;
  double radius;
};

Ball3d around_box(const BoxNode& node, int k) {
  const Eigen::Vector3d low(node.min_x[k], node.min_y[k], node.min_z[k]);
  const Eigen::Vector3d high(node.max_x[k], node.max_y[k], node.max_z[k]);
  return {0.5 * (low + high), 0.5 * (high - low).norm()};
}

}  // namespace

// Culling by unsigned distance fails inside, where the deepest point is wanted. The signed distance
// changes by no more than the way between two points, so its exact value at a box's middle bounds
// all of the box: branch and bound over the boxes that may hold points inside.
void LinkQuery::find_depth(Deadline* deadline) {
  const double interior = link_->tree.interior_gap() + 3.0 * rounding_;
  std::array<Entry, 1024> stack;  // 16 children on each of at most 8 levels, and room
  std::size_t top = 0;
  stack[top++] = {-std::numeric_limits<double>::infinity(), index_->root()};
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
      find_depth_in_tile(~entry.child);
      continue;
    }
    const BoxNode& node = index_->nodes()[static_cast<std::size_t>(entry.child)];
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      const Ball3d ball = around_box(node, k);
      const Eigen::Vector3d p_L = X_LO_ * ball.center;
      // Farther boxes hold no point inside; what they hold outside the descent has seen.
      if (link_->tree.outer_distance(p_L, interior + ball.radius) > interior + ball.radius) continue;
      ++statistics_->exact_evaluations;
      const double bound = link_->solid.signed_distance(p_L).distance - ball.radius;
      if (bound >= threshold()) {
        drop(bound);
        continue;
      }
      std::size_t at = top++;
      for (; at > begin && stack[at - 1].bound < bound; --at) stack[at] = stack[at - 1];
      stack[at] = {bound, node.child[k]};
    }
  }
}

void LinkQuery::find_depth_in_tile(std::int32_t tile) {
  const double interior = link_->tree.interior_gap() + 3.0 * rounding_;
  const int count = index_->tiles()[static_cast<std::size_t>(tile)].count;
  for (int lane = 0; lane < count; ++lane) {
    const Eigen::Vector3d p_L = X_LO_ * point_O(tile, lane);
    if (link_->tree.outer_distance(p_L, interior) > interior) continue;
    ++statistics_->exact_evaluations;
    take(link_->solid.signed_distance(p_L), p_L, tile, lane);
  }
}

}  // namespace ist
