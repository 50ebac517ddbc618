#include "proximity/link_pair_query.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "internal/geometry/numbers.h"
#include "internal/geometry/solid_queries.h"
#include "proximity/link_pair_search.h"

namespace ist {
namespace {

// Pairs of boxes that the front may hold.
constexpr std::size_t kFrontCapacity = 1024;

double extent(const LinkModel& link) { return link.tree.center().norm() + link.tree.radius(); }

// [m] No point of A moves farther in B's frame, or none of B in A's, whichever is less.
double relative_displacement(const LinkSurface& a, const LinkSurface& b,
                             const Eigen::Isometry3d& old_X_BA, const Eigen::Isometry3d& X_BA) {
  return std::min(a.displacement.between(old_X_BA, X_BA),
                  b.displacement.between(old_X_BA.inverse(), X_BA.inverse()));
}

}  // namespace

LinkPairQuery::LinkPairQuery(const LinkModel& a, const LinkModel& b, const LinkSurface& surface_a,
                             const LinkSurface& surface_b, LinkPairQuery* memory)
    : a_(a),
      b_(b),
      surface_a_(surface_a),
      surface_b_(surface_b),
      surfaces_(surface_a.surface, surface_b.surface, kFrontCapacity,
                memory != nullptr ? &memory->surfaces_ : nullptr),
      openings_a_(surface_a, surface_b, memory != nullptr ? &memory->openings_a_ : nullptr),
      openings_b_(surface_b, surface_a, memory != nullptr ? &memory->openings_b_ : nullptr),
      are_closed_(a.solid.is_closed() && b.solid.is_closed()),
      kept_bound_(depth_limit()),
      depth_bound_(depth_limit()) {}

// [m] No point of one is deeper inside the other.
double LinkPairQuery::depth_limit() const {
  return -std::max(surface_a_.depth_limit, surface_b_.depth_limit);
}

// [m] The error of a distance by poses that are not quite rigid.
double LinkPairQuery::pose_uncertainty(double distance) const {
  return pose_error(drift_, extent(a_) + extent(b_), distance);
}

void LinkPairQuery::move_to(const RigidPose& X_FA, const RigidPose& X_FB,
                            const QueryConfig& config) {
  const Eigen::Isometry3d X_BA = relative_pose(X_FB.X, X_FA.X);
  const double moved =
      has_pose_ ? relative_displacement(surface_a_, surface_b_, X_BA_, X_BA) : kInfinity;
  const double since_reference =
      has_pose_ ? relative_displacement(surface_a_, surface_b_, surfaces_.reference_pose(), X_BA)
                : kInfinity;
  kept_bound_ = are_closed_ && has_pose_ ? lower_bound() - moved : depth_limit();
  openings_a_.note_motion(moved);
  openings_b_.note_motion(moved);
  // Surfaces that are apart stay apart while no point moves as far as the other surface, or an
  // opening.
  are_apart_ = are_apart_ && moved < surfaces_.lower_bound() && openings_a_.stays_apart() &&
               openings_b_.stays_apart();
  X_BA_ = X_BA;
  X_FB_ = X_FB.X;
  drift_ = X_FA.drift + X_FB.drift;
  has_pose_ = true;
  config_ = config;
  range_ = config.max_distance + config.margin;
  range_ += pose_uncertainty(range_);
  surfaces_.move_to(X_BA, since_reference);
  is_finished_ = are_in_contact_ = false;
  depth_bound_ = depth_limit();
  depth_distance_ = kInfinity;
}

bool LinkPairQuery::advance(int* steps) {
  if (is_finished_) return true;
  // Links that are farther apart than numbers reach have no place in one another's frame.
  if (!X_BA_.matrix().allFinite()) return is_finished_ = true;
  if (!surfaces_.run({range_, config_.tolerance, config_.relative_tolerance}, steps)) return false;
  decide_contact(steps);
  if (!are_apart_) search_spheres();
  if (are_in_contact_) measure_depth();
  if (!are_apart_ && are_closed_) bound_by_slabs();
  is_finished_ = true;
  return true;
}

void LinkPairQuery::decide_contact(int* steps) {
  using Answer = OpeningSearch::Answer;
  are_in_contact_ = surfaces_.distance() <= 0.0;
  are_apart_ = are_apart_ && !are_in_contact_;
  if (are_in_contact_ || are_apart_ || !(surfaces_.lower_bound() > 0.0)) return;
  if (are_hulls_apart()) return;
  are_in_contact_ = find_inside_point();
  if (are_in_contact_) return;
  const Answer into_a = openings_a_.decide(X_BA_, steps);
  const Answer into_b = openings_b_.decide(X_BA_.inverse(), steps);
  are_in_contact_ = into_a == Answer::kInside || into_b == Answer::kInside;
  if (into_a == Answer::kInside) measure_depth_at(openings_a_.inside_B(), false);
  if (into_b == Answer::kInside) measure_depth_at(X_BA_ * openings_b_.inside_B(), true);
  are_apart_ = into_a == Answer::kApart && into_b == Answer::kApart;
}

// Whether the insides of both lie on the two sides of a slab.
bool LinkPairQuery::are_hulls_apart() {
  const double clearance =
      surfaces_.separation() - surface_a_.opening_margin - surface_b_.opening_margin;
  if (!(clearance > 0.0)) return false;
  openings_a_.note_clearance(clearance);
  openings_b_.note_clearance(clearance);
  return are_apart_ = true;
}

// Finds a component of one that is inside the other, where the surfaces are apart. A point of it
// has a depth, which the spheres and the places where surfaces touch may not show.
bool LinkPairQuery::find_inside_point() {
  const Eigen::Isometry3d X_AB = X_BA_.inverse();
  const auto holds = [](const LinkModel& link, const SurfaceBvh& surface,
                        const Eigen::Vector3d& p) {
    return surface.bounds().contains(p) && link.solid.is_inside(p);
  };
  for (const Eigen::Vector3d& p_A : surface_a_.component_points) {
    if (!holds(b_, surface_b_.surface, X_BA_ * p_A)) continue;
    measure_depth_at(X_BA_ * p_A, true);
    return true;
  }
  for (const Eigen::Vector3d& p_B : surface_b_.component_points) {
    if (!holds(a_, surface_a_.surface, X_AB * p_B)) continue;
    measure_depth_at(p_B, false);
    return true;
  }
  return false;
}

// Bounds the depth by the spheres of both, also where it is not decided whether there is one: less
// than a nanometre from touch, or where a surface is next to an opening. A point that is found
// inside both decides that.
void LinkPairQuery::search_spheres() {
  QueryConfig config = config_;
  config.max_distance = range_;
  LinkPairSearch of_a(a_, b_, X_BA_, config);
  of_a.run();
  keep_deeper(of_a.p_BCa(), of_a.closest(), true);
  LinkPairSearch of_b(b_, a_, X_BA_.inverse(), config);
  of_b.run();
  keep_deeper(X_BA_ * of_b.p_BCa(), of_b.closest(), false);
  depth_bound_ = std::min(of_a.lower_bound(), of_b.lower_bound());
  // No point of either is inside the other.
  are_apart_ = !are_in_contact_ && depth_bound_ > 0.0 && surfaces_.lower_bound() > 0.0;
  are_in_contact_ = are_in_contact_ || depth_distance_ < 0.0;
  depth_bound_ = std::max({std::min(depth_bound_, 0.0), kept_bound_, depth_limit()});
}

void LinkPairQuery::measure_depth() {
  if (!(depth_distance_ < 0.0)) search_from_touch();
  if (!(depth_distance_ < 0.0)) search_along_parts();
  depth_bound_ = std::min(depth_bound_, depth_distance_);
}

// Measures a point of one link against the other.
void LinkPairQuery::measure_depth_at(const Eigen::Vector3d& q_B, bool is_of_a) {
  const SignedDistance found =
      is_of_a ? b_.solid.signed_distance(q_B) : a_.solid.signed_distance(X_BA_.inverse() * q_B);
  keep_deeper(q_B, found, is_of_a);
}

// Keeps a point of one link if it is the deepest so far.
// @param found  the point's signed distance to the other link, in that link's frame
void LinkPairQuery::keep_deeper(const Eigen::Vector3d& q_B, const SignedDistance& found,
                                bool is_of_a) {
  if (!(found.distance < depth_distance_)) return;
  depth_distance_ = found.distance;
  on_a_ = is_of_a ? q_B : Eigen::Vector3d(X_BA_ * found.witness);
  on_b_ = is_of_a ? found.witness : q_B;
  direction_ = is_of_a ? found.normal : Eigen::Vector3d(-(X_BA_.linear() * found.normal));
}

// Steps from a point where the surfaces meet, alternately into the one and the other: solids that
// merely graze one another have so little in common that their spheres do not show it.
void LinkPairQuery::search_from_touch() {
  constexpr double kFirst = 1e-3, kLast = 1e-9;  // [m]
  constexpr int kProjections = 8;
  const Eigen::Vector3d touch_B = surfaces_.closest().on_q;
  const Eigen::Isometry3d X_AB = X_BA_.inverse();
  on_a_ = on_b_ = touch_B;
  direction_ = b_.solid.signed_distance(touch_B).normal;
  depth_distance_ = 0.0;
  for (double depth = kFirst; depth > kLast && depth_distance_ == 0.0; depth *= 0.25) {
    Eigen::Vector3d q_B = touch_B;
    for (int i = 0; i < kProjections; ++i) {
      const SignedDistance to_b = b_.solid.signed_distance(q_B);
      const SignedDistance to_a = a_.solid.signed_distance(X_AB * q_B);
      if (to_a.distance < 0.0) keep_deeper(q_B, to_b, true);
      if (to_a.distance > to_b.distance) {
        q_B -= (to_a.distance + depth) * (X_BA_.linear() * to_a.normal);
      } else {
        q_B -= (to_b.distance + depth) * to_b.normal;
      }
    }
  }
}

// Some corners of a triangle that passes through the other link lead inward: points from where it
// touches to a corner are measured.
void LinkPairQuery::search_along_parts() {
  constexpr double kLast = 1e-7;  // share of the way to the corner
  const Eigen::Vector3d touch_B = surfaces_.closest().on_q;
  for (const bool is_of_a : {true, false}) {
    const ConvexPart part = is_of_a ? surfaces_.part_a() : surfaces_.part_b();
    if (part.kind != ConvexPart::Kind::kTriangle) continue;
    for (const Eigen::Vector3d& corner : {part.a, part.b, part.c}) {
      for (double share = 1.0; share > kLast; share *= 0.25) {
        measure_depth_at(touch_B + share * (corner - touch_B), is_of_a);
      }
    }
  }
}

// Closed links have in common no more than a slab between a plane below which all of B is and one
// above which all of A is: what is in the slab leaves the one or the other link by its width. The
// thinnest slab is looked for where links graze one another, as spheres say little there: from the
// normals of the surfaces and the way between the links on, by turns that are halved.
void LinkPairQuery::bound_by_slabs() {
  constexpr double kGrazing = 1e-3;                      // [m] spheres bound what is deeper
  constexpr double kFirstTurn = 0.5, kLastTurn = 1e-10;  // [rad] 0.1 nm for a link of 1 m
  const ConvexDistance& closest = surfaces_.closest();
  const double wanted = are_in_contact_ ? depth_distance_ : 0.0;
  if (!(closest.distance < kInfinity) || wanted < -kGrazing) return;
  Eigen::Vector3d up_B = X_BA_ * a_.tree.center() - b_.tree.center();
  double width = slab_width(up_B.normalized());
  const auto take = [&](const Eigen::Vector3d& direction_B) {
    const double found = slab_width(direction_B);
    if (!(found < width)) return false;
    width = found;
    up_B = direction_B;
    return true;
  };
  up_B.normalize();
  if (are_in_contact_) take(direction_);
  take(b_.solid.signed_distance(closest.on_q).normal);
  take(-(X_BA_.linear() * a_.solid.signed_distance(X_BA_.inverse() * closest.on_p).normal));
  for (double turn = kFirstTurn; turn > kLastTurn && -width < wanted - config_.tolerance;) {
    // NOLINTNEXTLINE(performance-unnecessary-copy-initialization): take() changes up_B
    const Eigen::Vector3d from_B = up_B;
    const Eigen::Vector3d x_B = from_B.unitOrthogonal(), y_B = from_B.cross(x_B);
    bool is_thinner = false;
    for (const double sign : {-turn, turn}) {
      is_thinner = take((from_B + sign * x_B).normalized()) || is_thinner;
      is_thinner = take((from_B + sign * y_B).normalized()) || is_thinner;
    }
    if (!is_thinner) turn *= 0.5;
  }
  depth_bound_ = std::max(depth_bound_, std::min(-width, wanted));
}

// [m] Of the slab across a direction from B to A, at least; +inf where it is no unit vector.
double LinkPairQuery::slab_width(const Eigen::Vector3d& up_B) const {
  constexpr double kRounding = 1e-14;  // of the lengths that are added
  if (!(std::abs(up_B.squaredNorm() - 1.0) < 1e-9)) return kInfinity;
  const Eigen::Vector3d down_A = -(X_BA_.linear().transpose() * up_B);
  const double top_of_b = support(b_.solid, up_B);
  const double bottom_of_a = up_B.dot(X_BA_.translation()) - support(a_.solid, down_A);
  const double scale = X_BA_.translation().norm() + extent(a_) + extent(b_);
  return top_of_b - bottom_of_a + kRounding * scale;
}

double LinkPairQuery::lower_bound() const {
  if (are_in_contact_) return depth_bound_;
  if (are_apart_) return std::max(surfaces_.lower_bound(), kept_bound_);
  return std::max(depth_bound_, kept_bound_);
}

void LinkPairQuery::report(PairProximity* result) const {
  result->reset();
  result->finished = is_finished_;
  const double lower = lower_bound();
  if (lower >= range_) {
    result->decided = is_decided();
    result->state = LinkState::kClear;
    result->distance = kInfinity;
    result->lower_bound = config_.max_distance;
    return;
  }
  const ConvexDistance& closest = surfaces_.closest();
  if (!are_in_contact_ && !(closest.distance > 0.0 && closest.distance < kInfinity)) return;
  result->decided = is_decided();
  result->lower_bound = lower - pose_uncertainty(lower) - config_.margin;
  result->state = are_in_contact_ && depth_distance_ < 0.0 ? LinkState::kContact : LinkState::kNear;
  result->distance = are_in_contact_ ? depth_distance_ : closest.distance;
  result->p_FCa = X_FB_ * (are_in_contact_ ? on_a_ : closest.on_p);
  result->p_FCb = X_FB_ * (are_in_contact_ ? on_b_ : closest.on_q);
  result->direction =
      X_FB_.linear() * (are_in_contact_ ? direction_ : (closest.on_p - closest.on_q).normalized());
}

}  // namespace ist
