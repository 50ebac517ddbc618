#include "proximity/link_pair_query.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

// Pairs of boxes that the front may hold.
constexpr std::size_t kFrontCapacity = 1024;
// Distances that the search for the depth may measure, in each direction.
constexpr int kDepthSteps = 100;

double extent(const LinkModel& link) { return link.tree.center().norm() + link.tree.radius(); }

// [m] No point of A moves farther in B's frame, or none of B in A's, whichever is less.
double relative_displacement(const LinkSurface& a, const LinkSurface& b,
                             const Eigen::Isometry3d& old_X_BA, const Eigen::Isometry3d& X_BA) {
  return std::min(a.displacement.between(old_X_BA, X_BA),
                  b.displacement.between(old_X_BA.inverse(), X_BA.inverse()));
}

}  // namespace

LinkPairQuery::LinkPairQuery(const LinkModel& a, const LinkModel& b, const LinkSurface& surface_a,
                             const LinkSurface& surface_b)
    : a_(a),
      b_(b),
      surface_a_(surface_a),
      surface_b_(surface_b),
      surfaces_(surface_a.surface, surface_b.surface, kFrontCapacity),
      openings_a_(surface_a, surface_b),
      openings_b_(surface_b, surface_a),
      are_closed_(a.solid.is_closed() && b.solid.is_closed()),
      kept_bound_(depth_limit()),
      depth_bound_(depth_limit()) {}

LinkPairQuery::LinkPairQuery(const LinkModel& a, const LinkModel& b, const LinkSurface& surface_a,
                             const LinkSurface& surface_b, LinkPairQuery&& memory)
    : a_(a),
      b_(b),
      surface_a_(surface_a),
      surface_b_(surface_b),
      surfaces_(surface_a.surface, surface_b.surface, kFrontCapacity, std::move(memory.surfaces_)),
      openings_a_(surface_a, surface_b, std::move(memory.openings_a_)),
      openings_b_(surface_b, surface_a, std::move(memory.openings_b_)),
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
      has_pose_ ? relative_displacement(surface_a_, surface_b_, X_BA_, X_BA) : kInf;
  const double since_reference =
      has_pose_ ? relative_displacement(surface_a_, surface_b_, surfaces_.reference_pose(), X_BA)
                : kInf;
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
  stage_ = Stage::kSurfaces;
  are_in_contact_ = has_inside_ = false;
  depth_bound_ = depth_limit();
}

bool LinkPairQuery::advance(int* steps, std::vector<LinkPairSearch::Entry>* queue) {
  if (stage_ == Stage::kSurfaces) {
    if (!surfaces_.run({range_, config_.tolerance, config_.relative_tolerance}, steps))
      return false;
    stage_ = Stage::kInside;
  }
  if (stage_ == Stage::kInside) {
    decide_contact(steps);
    if (!are_apart_) search_spheres(queue);
    if (are_in_contact_) measure_depth();
    if (!are_apart_ && are_closed_) bound_by_slabs();
    stage_ = Stage::kDone;
  }
  return true;
}

void LinkPairQuery::decide_contact(int* steps) {
  using Answer = OpeningSearch::Answer;
  are_in_contact_ = surfaces_.distance() <= 0.0;
  are_apart_ = are_apart_ && !are_in_contact_;
  if (are_in_contact_ || are_apart_ || !(surfaces_.lower_bound() > 0.0)) return;
  if (are_hulls_apart()) return;
  are_in_contact_ = is_inside_other();
  if (are_in_contact_) return;
  const Answer into_a = openings_a_.decide(X_BA_, steps);
  const Answer into_b = openings_b_.decide(X_BA_.inverse(), steps);
  if (into_a == Answer::kInside) note_inside(openings_a_.inside_B(), false);
  if (into_b == Answer::kInside) note_inside(openings_b_.inside_B(), true);
  are_in_contact_ = has_inside_;
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

// Tells whether a component of one is inside the other, where the surfaces are apart.
bool LinkPairQuery::is_inside_other() {
  const Eigen::Isometry3d X_AB = X_BA_.inverse();
  const auto holds = [](const LinkModel& link, const SurfaceBvh& surface,
                        const Eigen::Vector3d& p) {
    return surface.bounds().contains(p) && link.solid.is_inside(p);
  };
  for (const Eigen::Vector3d& p_A : surface_a_.component_points) {
    if (!holds(b_, surface_b_.surface, X_BA_ * p_A)) continue;
    note_inside(p_A, true);
    return true;
  }
  for (const Eigen::Vector3d& p_B : surface_b_.component_points) {
    if (!holds(a_, surface_a_.surface, X_AB * p_B)) continue;
    note_inside(p_B, false);
    return true;
  }
  return false;
}

void LinkPairQuery::note_inside(const Eigen::Vector3d& p, bool of_a) {
  has_inside_ = true;
  is_inside_of_a_ = of_a;
  inside_ = p;
}

// Keeps the witnesses of a search for the depth if they are deeper.
void LinkPairQuery::keep_deepest(const LinkPairSearch& search, bool of_a) {
  depth_bound_ = std::min(depth_bound_, search.lower_bound());
  if (!(search.distance() < depth_distance_)) return;
  depth_distance_ = search.distance();
  if (of_a) {
    on_a_ = search.p_BCa();
    on_b_ = search.p_BCb();
    direction_ = search.normal_B();
  } else {  // in A's frame, and the link that is searched is B
    on_a_ = X_BA_ * search.p_BCb();
    on_b_ = X_BA_ * search.p_BCa();
    direction_ = -(X_BA_.linear() * search.normal_B());
  }
}

// Bounds the depth by the spheres of both, also where it is not decided whether there is one: less
// than a nanometre from touch, or where a surface is next to an opening. A point that is found
// inside both decides that.
void LinkPairQuery::search_spheres(std::vector<LinkPairSearch::Entry>* queue) {
  depth_bound_ = kInf;
  depth_distance_ = kInf;
  QueryConfig config = config_;
  config.max_distance = range_;
  LinkPairSearch of_a(a_, b_, X_BA_, config, queue);
  of_a.run(kDepthSteps);
  keep_deepest(of_a, true);
  LinkPairSearch of_b(b_, a_, X_BA_.inverse(), config, queue);
  of_b.run(kDepthSteps);
  keep_deepest(of_b, false);
  // No point of either is inside the other.
  are_apart_ = !are_in_contact_ && depth_bound_ > 0.0 && surfaces_.lower_bound() > 0.0;
  are_in_contact_ = are_in_contact_ || depth_distance_ < 0.0;
  depth_bound_ = std::max({std::min(depth_bound_, 0.0), kept_bound_, depth_limit()});
}

void LinkPairQuery::measure_depth() {
  if (has_inside_) measure_inside_point();
  if (!(depth_distance_ < 0.0)) search_from_touch();
  if (!(depth_distance_ < 0.0)) search_along_parts();
  depth_bound_ = std::min(depth_bound_, depth_distance_);
}

// The surfaces may be far apart where one link reaches into the other through an opening, and the
// spheres may show no point inside both.
void LinkPairQuery::measure_inside_point() {
  const Eigen::Vector3d q_B = is_inside_of_a_ ? Eigen::Vector3d(X_BA_ * inside_) : inside_;
  const SignedDistance found = is_inside_of_a_ ? b_.solid.signed_distance(q_B)
                                               : a_.solid.signed_distance(X_BA_.inverse() * q_B);
  if (!(found.distance < std::min(depth_distance_, 0.0))) return;
  depth_distance_ = found.distance;
  on_a_ = is_inside_of_a_ ? q_B : Eigen::Vector3d(X_BA_ * found.witness);
  on_b_ = is_inside_of_a_ ? found.witness : q_B;
  direction_ = is_inside_of_a_ ? found.normal : Eigen::Vector3d(-(X_BA_.linear() * found.normal));
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
      if (to_a.distance < 0.0 && to_b.distance < depth_distance_) {
        depth_distance_ = to_b.distance;
        on_a_ = q_B;
        on_b_ = to_b.witness;
        direction_ = to_b.normal;
      }
      if (to_a.distance > to_b.distance) {
        q_B -= (to_a.distance + depth) * (X_BA_.linear() * to_a.normal);
      } else {
        q_B -= (to_b.distance + depth) * to_b.normal;
      }
    }
  }
}

// Some corners of a triangle that passes through the other link lead inward.
void LinkPairQuery::search_along_parts() {
  const ConvexPart parts[] = {surfaces_.part_a(), surfaces_.part_b()};
  for (int i = 0; i < 2; ++i) {
    if (parts[i].kind != ConvexPart::Kind::kTriangle) continue;
    for (const Eigen::Vector3d& corner : {parts[i].a, parts[i].b, parts[i].c}) {
      search_toward(corner, i == 0);
    }
  }
}

// Measures points of one link, from a corner of a touching triangle to where it touches, against
// the other link.
void LinkPairQuery::search_toward(const Eigen::Vector3d& corner_B, bool is_of_a) {
  constexpr double kLast = 1e-7;  // share of the way to the corner
  const Eigen::Vector3d touch_B = surfaces_.closest().on_q;
  const Eigen::Isometry3d X_AB = X_BA_.inverse();
  for (double share = 1.0; share > kLast; share *= 0.25) {
    const Eigen::Vector3d q_B = touch_B + share * (corner_B - touch_B);
    const SignedDistance found =
        is_of_a ? b_.solid.signed_distance(q_B) : a_.solid.signed_distance(X_AB * q_B);
    if (!(found.distance < depth_distance_)) continue;
    depth_distance_ = found.distance;
    on_a_ = is_of_a ? q_B : Eigen::Vector3d(X_BA_ * found.witness);
    on_b_ = is_of_a ? found.witness : q_B;
    direction_ = is_of_a ? found.normal : Eigen::Vector3d(-(X_BA_.linear() * found.normal));
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
  if (!(closest.distance < kInf) || wanted < -kGrazing) return;
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
    const Eigen::Vector3d x_B = up_B.unitOrthogonal(), y_B = up_B.cross(x_B), from_B = up_B;
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
  if (!(std::abs(up_B.squaredNorm() - 1.0) < 1e-9)) return kInf;
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
  result->finished = stage_ == Stage::kDone;
  result->decided = is_decided();
  const double lower = lower_bound();
  if (lower >= range_) {
    result->state = LinkState::kClear;
    result->distance = kInf;
    result->lower_bound = config_.max_distance;
    return;
  }
  result->lower_bound = lower - pose_uncertainty(lower) - config_.margin;
  if (are_in_contact_) {
    result->state = depth_distance_ < 0.0 ? LinkState::kContact : LinkState::kNear;
    result->distance = depth_distance_;
    result->p_FCa = X_FB_ * on_a_;
    result->p_FCb = X_FB_ * on_b_;
    result->direction = X_FB_.linear() * direction_;
    return;
  }
  const ConvexDistance& closest = surfaces_.closest();
  if (!(closest.distance > 0.0 && closest.distance < kInf)) {
    result->reset();
    result->finished = stage_ == Stage::kDone;
    return;
  }
  result->state = LinkState::kNear;
  result->distance = closest.distance;
  result->p_FCa = X_FB_ * closest.on_p;
  result->p_FCb = X_FB_ * closest.on_q;
  result->direction = X_FB_.linear() * (closest.on_p - closest.on_q).normalized();
}

}  // namespace ist
