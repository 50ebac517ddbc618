// Points that a descent has found and that wait for their exact distance.

#include <algorithm>
#include <limits>

#include "proximity/link_query.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

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
  while (true) {
    drop_far_waiting();
    if (waiting_count_ == 0) return;
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

}  // namespace ist
