// The part of a link's query that looks for points inside the link.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "proximity/around.h"
#include "proximity/link_query.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What was found about a box's middle is as good as new after such a share of its radius.
constexpr double kSmallWay = 0.25;

struct Entry {
  double bound;            ///< [m] no point below has a smaller signed distance
  Eigen::Vector3d center;  ///< of the box, link frame
  double floor;            ///< [m] at the centre, see PointDepth
  double guess;            ///< [m] as `bound`, holes left out of account: which to visit first
  std::int32_t child;
};

}  // namespace

// Culling by unsigned distance fails inside, where the deepest point is wanted. The signed distance
// falls by no more than the way between two points (but for holes, see PointDepth), so its exact
// value at a box's middle bounds all of the box: branch and bound over the boxes that may hold
// points inside. Most are done with as soon as any triangle is found too near for them to matter.
void LinkQuery::find_depth(Deadline* deadline) {
  std::array<Entry, 512> stack;  // 16 children on each of at most 8 levels, and room
  std::size_t top = 0;
  stack[top++] = {-kInfinity, Eigen::Vector3d::Zero(), -kInfinity, -kInfinity, index_->root()};
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
      find_depth_in_tile(~entry.child, entry.center, entry.floor);
      continue;
    }
    const BoxNode& node = index_->nodes()[static_cast<std::size_t>(entry.child)];
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      const Around ball = around_child(node, k);
      const Eigen::Vector3d center = X_LO_ * ball.center;
      const double inherited = entry.floor - (center - entry.center).norm() - ball.radius;
      if (inherited >= threshold()) {
        drop(inherited);
        continue;
      }
      const auto id =
          static_cast<std::uint32_t>(entry.child) * kPointWidth + static_cast<std::uint32_t>(k);
      const BoxDepth depth = box_depth(center, ball.radius, id);
      if (!depth.matters) continue;
      const double bound = depth.floor - ball.radius;
      if (bound >= threshold()) {
        drop(bound);
        continue;
      }
      std::size_t at = top++;
      for (; at > begin && stack[at - 1].guess < depth.guess; --at) stack[at] = stack[at - 1];
      stack[at] = {bound, center, depth.floor, depth.guess, node.child[k]};
    }
  }
}

// What was found about the box lately is enough where it rules the box out, or could not rule it
// out if it were found anew.
LinkQuery::BoxDepth LinkQuery::box_depth(const Eigen::Vector3d& center, double radius,
                                         std::uint32_t id) {
  constexpr auto kKind = KnownDistances::Kind::kBoxMiddle;
  const std::uint64_t index = index_->generation();
  const KnownDistances::Known known = known_.at(index, kKind, id, center);
  const double limit = threshold() + radius;
  const bool is_open =
      known.floor > -kInfinity && known.floor + known.way < limit && known.way < kSmallWay * radius;
  if (known.floor >= limit || is_open) return {true, known.floor, known.guess};
  // Farther boxes hold no point inside; what they hold outside the descent has seen.
  if (link_->tree.is_beyond(center, interior_reach() + radius)) return {};
  ++statistics_->exact_evaluations;
  const PointDepth depth = link_->solid.depth(center, -limit);
  const double guess = std::min(depth.exact.distance, std::abs(depth.floor)) - radius;
  known_.keep(index, kKind, id, center, depth.floor, guess);
  return {true, depth.floor, guess};
}

// Each point that is evaluated bounds its neighbours too, so few of the sixteen have to be.
void LinkQuery::find_depth_in_tile(std::int32_t tile, const Eigen::Vector3d& center, double floor) {
  const double interior = interior_reach();
  const std::uint64_t index = index_->generation();
  PointTile room;
  const PointTile& points = index_->tile(static_cast<std::size_t>(tile), &room);
  const int count = points.count;
  std::array<Eigen::Vector3d, kPointWidth> p_L;
  std::array<double, kPointWidth> bound;
  std::array<bool, kPointWidth> open;
  for (int k = 0; k < count; ++k) {
    const auto i = static_cast<std::size_t>(k);
    p_L[i] = X_LO_ * points.point(k);
    const double known =
        known_.at(index, KnownDistances::Kind::kPoint, key_of(tile, k), p_L[i]).floor;
    bound[i] = std::max(floor - (p_L[i] - center).norm(), known);
    open[i] = true;
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
    if (link_->tree.is_beyond(p_L[i], interior)) continue;
    ++statistics_->exact_evaluations;
    const PointDepth depth = link_->solid.depth(p_L[i], -threshold());
    known_.keep(index, KnownDistances::Kind::kPoint, key_of(tile, next), p_L[i], depth.floor);
    if (depth.exact.distance < kInfinity) {
      take(depth.exact, p_L[i], point_O(tile, next), tile, next);
    } else {
      drop(std::max(depth.floor, threshold()));
    }
    for (int k = 0; k < count; ++k) {
      const auto j = static_cast<std::size_t>(k);
      bound[j] = std::max(bound[j], depth.floor - (p_L[j] - p_L[i]).norm());
    }
  }
}

}  // namespace ist
