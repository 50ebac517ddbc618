#include "proximity/link_pair_search.h"

#include <algorithm>

#include "internal/geometry/numbers.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

constexpr int kMaxProjections = 20;

}  // namespace

LinkPairSearch::LinkPairSearch(const LinkModel& a, const LinkModel& b,
                               const Eigen::Isometry3d& X_BA, const QueryConfig& config)
    : a_(a),
      b_(b),
      X_BA_(X_BA),
      X_AB_(X_BA.inverse()),
      config_(config),
      has_holes_(!a.solid.is_closed() || !b.solid.is_closed()) {}

void LinkPairSearch::run() {
  push(a_.tree.center(), a_.tree.radius(), 0);
  for (int step = 0; step < kMaxSteps && size_ > 0 && queue_[0].bound < prune_bound(); ++step) {
    std::pop_heap(queue_.begin(), queue_.begin() + size_);
    const std::int32_t child = queue_[--size_].child;
    if (child < 0) {
      visit_leaf(a_.tree.leaves()[static_cast<std::size_t>(~child)]);
      continue;
    }
    const SphereNode& node = a_.tree.nodes()[static_cast<std::size_t>(child)];
    for (int k = 0; k < node.count; ++k) {
      push({node.x[k], node.y[k], node.z[k]}, node.radius[k], node.child[k]);
    }
  }
  if (size_ > 0) prune(queue_[0].bound);
  lower_bound_ = std::min(lower_bound_, closest_.distance);
  lower_bound_ -= interior_allowance();
}

// Cover spheres cover a link's surface; its interior may be the interior gap farther from them. An
// interior point is nearest only if a part of B is inside A too, or if it shows through a hole.
double LinkPairSearch::interior_allowance() const {
  const double gap_a = a_.tree.interior_gap(), gap_b = b_.tree.interior_gap();
  if (has_holes_) return gap_a + gap_b;
  return lower_bound_ <= gap_a ? gap_a : 0.0;
}

// Parts whose bound is not below this change neither the lower bound nor, by more than the
// tolerance, the distance. While the lower bound alone allows contact, no part that may be in
// contact is pruned.
double LinkPairSearch::prune_bound() const {
  const double decided = lower_bound_ > 0.0 || closest_.distance < 0.0 ? lower_bound_ : 0.0;
  const double allowance = has_holes_ ? interior_allowance() : 0.0;
  return std::min(
      {decided, closest_.distance - config_.tolerance, config_.max_distance + allowance});
}

// A lower bound of the signed distance of all points within `radius` of p_B, from B's cover spheres
// alone; -inf where they prove nothing. Through a hole the signed distance jumps, so there all of
// the points must be outside.
double LinkPairSearch::cover_bound(const Eigen::Vector3d& p_B, double radius) const {
  const double gap = b_.tree.interior_gap();
  const double outer = b_.tree.cover_distance(p_B, gap + (has_holes_ ? radius : 0.0));
  return outer > gap + (has_holes_ ? radius : 0.0) ? outer - radius : -kInfinity;
}

void LinkPairSearch::push(const Eigen::Vector3d& p_A, double radius, std::int32_t child) {
  const Eigen::Vector3d p_B = X_BA_ * p_A;
  double bound = cover_bound(p_B, radius);
  if (bound == -kInfinity) {
    bound = distance_floor(b_.solid, p_B, b_.solid.signed_distance(p_B)) - radius;
  }
  if (bound >= prune_bound()) return prune(bound);
  queue_[size_++] = {bound, child};
  std::push_heap(queue_.begin(), queue_.begin() + size_);
}

// A part that is not visited counts with its bound: the prune bound falls later on.
void LinkPairSearch::prune(double bound) { lower_bound_ = std::min(lower_bound_, bound); }

void LinkPairSearch::visit_leaf(const SphereLeaf& leaf) {
  for (int k = 0; k < leaf.count; ++k) {
    const Eigen::Vector3d p_A(leaf.x[k], leaf.y[k], leaf.z[k]), p_B = X_BA_ * p_A;
    const double from_cover = cover_bound(p_B, leaf.cover_radius[k]);
    if (from_cover >= prune_bound()) {
      prune(from_cover);
      continue;
    }
    const SignedDistance measured = b_.solid.signed_distance(p_B);
    const double exact = distance_floor(b_.solid, p_B, measured) - leaf.cover_radius[k];
    lower_bound_ = std::min(lower_bound_, std::max(exact, from_cover));
    if (measured.distance < std::max(leaf.inner_radius[k], 0.0F)) {
      search_deeper(p_A, measured, leaf.inner_radius[k]);
    }
    project_alternately(measured.witness);
  }
}

// For a sphere of A that intersects B: tries its centre, and points of it that may be deeper.
void LinkPairSearch::search_deeper(const Eigen::Vector3d& p_A, const SignedDistance& measured,
                                   double inner) {
  const Eigen::Vector3d p_B = X_BA_ * p_A;
  if (measured.distance < closest_.distance && a_.solid.is_inside(p_A)) set_closest(p_B, measured);
  const double most = 0.999 * std::max(inner, 0.0), least = std::max(measured.distance, 0.0);
  for (const double step : {most, 0.5 * (least + most)}) {
    const Eigen::Vector3d deeper_B = p_B - step * measured.normal;
    const SignedDistance deeper = b_.solid.signed_distance(deeper_B);
    if (deeper.distance < closest_.distance && a_.solid.is_inside(X_AB_ * deeper_B)) {
      set_closest(deeper_B, deeper);
    }
  }
}

// Alternating projections: from a point of B to the nearest of A, from there to the nearest of B,
// and so on, while the distance falls.
void LinkPairSearch::project_alternately(Eigen::Vector3d q_B) {
  for (int i = 0; i < kMaxProjections; ++i) {
    const Eigen::Vector3d q_A = X_AB_ * q_B;
    const SignedDistance on_a = a_.solid.signed_distance(q_A);
    const Eigen::Vector3d p_B = X_BA_ * on_a.witness;
    const SignedDistance measured = b_.solid.signed_distance(p_B);
    const double gain = closest_.distance - measured.distance;
    if (!(gain > 0.0)) return;
    set_closest(p_B, measured);
    if (gain < 0.01 * config_.tolerance) return;
    q_B = measured.witness;
  }
}

void LinkPairSearch::set_closest(const Eigen::Vector3d& p_B, const SignedDistance& measured) {
  p_BCa_ = p_B;
  closest_ = measured;
}

}  // namespace ist
