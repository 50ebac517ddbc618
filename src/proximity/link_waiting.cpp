// Points that a descent has found and that wait for their exact distance.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "proximity/link_query.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// So many points that may be nearest are worth a look at where the link ends.
constexpr std::size_t kManyWaiting = 16;

}  // namespace

bool LinkQuery::first_visit(std::int32_t tile, int lane) {
  const std::uint32_t key = key_of(tile, lane);
  Visit& visit = visit_of(key);
  const bool is_first = !is_visited(visit, key) || visit.waiting >= 0;
  visit = {epoch_, key, -1};
  return is_first;
}

void LinkQuery::on_candidate(void* context, std::int32_t tile, int lane, float bound) {
  auto* self = static_cast<LinkQuery*>(context);
  self->beyond_ = std::min(self->beyond_, static_cast<double>(bound) - self->rounding_);
  if (self->boxes_ != nullptr) {
    if (self->first_visit(tile, lane)) {
      self->consider(tile, lane, true, kInfinity, Eigen::Vector3d::Zero());
    }
    return;
  }
  const std::uint32_t key = key_of(tile, lane);
  Visit* visit = &self->visit_of(key);
  if (self->is_visited(*visit, key)) {  // by other spheres
    if (visit->waiting < 0) return;
    float& known = self->waiting_[static_cast<std::size_t>(visit->waiting)].bound;
    known = std::min(known, bound);
    return;
  }
  if (self->waiting_count_ == self->waiting_.size()) self->evaluate_waiting();
  *visit = {self->epoch_, key, static_cast<std::int32_t>(self->waiting_count_)};
  self->waiting_[self->waiting_count_++] = {bound, tile, lane};
}

// From the nearest sphere of a leaf to a point.
Eigen::Vector3d LinkQuery::way_from_sphere(std::int32_t leaf, const Eigen::Vector3d& p_L) const {
  const SphereLeaf& spheres = link_->tree.leaves()[static_cast<std::size_t>(leaf)];
  Eigen::Vector3d nearest = Eigen::Vector3d::Zero();
  double least = kInfinity;
  for (int k = 0; k < spheres.count; ++k) {
    const Eigen::Vector3d way = p_L - Eigen::Vector3d(spheres.x[k], spheres.y[k], spheres.z[k]);
    const double inner = way.norm() - static_cast<double>(spheres.inner_radius[k]);
    if (!(inner < least)) continue;
    least = inner;
    nearest = way;
  }
  return nearest.normalized();
}

// The exact distance in the place of what the inner spheres promise.
void LinkQuery::keep_promise() {
  if (promised_ == kInfinity) return;
  const std::int32_t tile = traversal_->inner_tile;
  const int lane = traversal_->inner_lane;
  if (first_visit(tile, lane)) {
    const Eigen::Vector3d toward =
        way_from_sphere(traversal_->inner_leaf, X_LO_ * point_O(tile, lane));
    consider(tile, lane, false, a_little_more(promised_), toward);
  }
  is_broken_ = is_broken_ || nearest_.exact.distance > promised_;
  promised_ = kInfinity;
}

// The most promising first: most of the others are spared.
void LinkQuery::evaluate_waiting() {
  keep_promise();
  for (int evaluated = 0;; ++evaluated) {
    drop_far_waiting();
    if (waiting_count_ == 0) return;
    if (evaluated == 2 && waiting_count_ >= kManyWaiting) {
      rule_out_waiting();
      continue;
    }
    const auto last = waiting_.begin() + static_cast<std::ptrdiff_t>(waiting_count_) - 1;
    std::iter_swap(
        last, std::min_element(waiting_.begin(), last + 1, [](const Waiting& a, const Waiting& b) {
          return a.bound < b.bound;
        }));
    --waiting_count_;
    if (first_visit(last->tile, last->lane)) {
      const bool knows_way = nearest_.exact.distance < kInfinity;
      consider(last->tile, last->lane, true, kInfinity, knows_way ? nearest_.exact.normal : aim_L_);
    }
  }
}

// Their bound is that of the spheres that were met so far; others may have less.
void LinkQuery::drop_far_waiting() {
  std::size_t left = 0;
  for (std::size_t i = 0; i < waiting_count_; ++i) {
    const Waiting point = waiting_[i];
    if (point.bound < traversal_->threshold) {
      waiting_[left++] = point;
      continue;
    }
    traversal_->dropped = std::min(traversal_->dropped, point.bound);
    const std::uint32_t key = key_of(point.tile, point.lane);
    Visit& visit = visit_of(key);
    if (is_visited(visit, key)) visit.epoch = 0;
  }
  waiting_count_ = left;
}

// Where obstacles are flat, or far, many points are about equally near as far as spheres can tell.
// The link's surface itself tells more: it ends in a plane across the way to the nearest point, and
// what of it is that near the plane is not wide. A point is at least as far as from a stack of
// discs, each as wide as the surface is down to the next one.
void LinkQuery::rule_out_waiting() {
  if (!(nearest_.exact.distance > 0.0) || nearest_.exact.distance == kInfinity) return;
  const Solid& solid = link_->solid;
  const Eigen::Vector3d n = nearest_.exact.normal, end = nearest_.exact.witness;
  const double limit = threshold(), highest = solid.support(n, 0.0, n.dot(end));
  std::array<double, kMaxWaiting> ahead, aside_sq;  // [m], [m^2] of the plane and of its axis
  double deepest = 0.0;
  for (std::size_t i = 0; i < waiting_count_; ++i) {
    const Eigen::Vector3d from_end = X_LO_ * point_O(waiting_[i].tile, waiting_[i].lane) - end;
    const double along = n.dot(from_end);
    ahead[i] = along + n.dot(end) - highest - kRounding;
    aside_sq[i] = (from_end - along * n).squaredNorm();
    deepest = std::max(deepest, limit - ahead[i]);
  }
  deepest = (1.0 + 1e-9) * std::max(deepest, kRounding);  // rounding must not leave it short
  TriangleBvh::EndDepths depths, widths;
  for (std::size_t k = depths.size(); k-- > 0; deepest *= 0.25) depths[k] = deepest;
  if (!solid.end_widths(n, end, highest, depths, static_cast<int>(4 * waiting_count_), &widths)) {
    return;
  }
  std::size_t left = 0;
  for (std::size_t i = 0; i < waiting_count_; ++i) {
    double bound_sq = ahead[i] + depths.back();
    bound_sq *= bound_sq;
    const double aside = std::max(std::sqrt(aside_sq[i]) - kRounding, 0.0);
    for (std::size_t k = 0; k < depths.size(); ++k) {
      const double above = std::max(ahead[i] + (k > 0 ? depths[k - 1] : 0.0), 0.0);
      const double beyond = std::max(aside - widths[k], 0.0);
      bound_sq = std::min(bound_sq, above * above + beyond * beyond);
    }
    const double bound = std::sqrt(bound_sq);
    if (bound >= limit) {
      drop(bound);
      first_visit(waiting_[i].tile, waiting_[i].lane);  // holds for all spheres: done with
    } else {
      waiting_[left++] = waiting_[i];
    }
  }
  waiting_count_ = left;
}

}  // namespace ist
