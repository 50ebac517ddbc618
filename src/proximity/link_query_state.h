#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "internal/geometry/distance_field.h"
#include "internal/geometry/float_rounding.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "proximity/coherence/extent_bound.h"
#include "proximity/coherence/link_bound.h"
#include "proximity/coherence/search_front.h"
#include "proximity/coherence/side_balls.h"
#include "proximity/link_bounds.h"
#include "proximity/posed_index.h"
#include "proximity/supporting_plane.h"

/// The state of a link's query: three types, by how long their content lives.
namespace ist {

/// [m] More than double loses where distances are compared.
inline constexpr double kDistanceRounding = 1e-12;

/// [m] A link is free where its bound is above 0: this is, and no more than that has to be proven.
inline constexpr double kFreeBound = 1e-6;

/// [s] Until each link has a first bound, a run may go on for so long after its deadline: an answer
/// that is this late is worth more than none.
inline constexpr double kFirstBounds = 5e-5;

/// The part that belongs to the link for ever, whatever its pose and whatever the clouds.
struct LinkContext {
  explicit LinkContext(const LinkModel& link) : model(&link), displacement(link) {}

  const LinkModel* model;
  DisplacementBound displacement;

  const InnerSphereTree& tree() const { return model->tree; }
  const Solid& solid() const { return model->solid; }
  /// The distances about the link; null: there are none.
  const DistanceField* field() const {
    return model->field != nullptr && !model->field->empty() ? model->field.get() : nullptr;
  }
  /// [m] No place inside the link is deeper. A mesh with holes may enclose places outside of the
  /// link's bounding sphere, but no farther from the cover spheres than the interior gap.
  double deepest() const {
    const double radius = tree().radius();
    return solid().is_closed() ? radius : 2.0 * radius + tree().interior_gap();
  }
};

/// The part of a link's answer that is to be proven.
enum class Goal {
  kFree,       ///< that it is free, where it is
  kHalf,       ///< its distance, to within half of it
  kTolerance,  ///< what was asked
};

/// The closest obstacle that a query has found, measured exactly.
struct ClosestObstacle {
  SignedDistance exact;  ///< link frame; `distance` is the upper bound, inf: none was found
  Eigen::Vector3d p_FCo = Eigen::Vector3d::Zero();  ///< [m] closest point of the obstacle
  std::int32_t source = -1;
  ObstacleId id;
  bool is_box = false;
};

/// The result for the spheres that obstacles stand for (PointExtent).
struct ExtentResult {
  double lower_bound = -std::numeric_limits<double>::infinity();  ///< [m] no sphere is nearer
  double upper = std::numeric_limits<double>::infinity();         ///< [m] some sphere is that near
};

/// The result of a query.
struct SearchResult {
  ClosestObstacle closest;
  ExtentResult extents;         ///< used where obstacles have extents
  double pruned_bound = 0.0;    ///< [m] least lower bound of all that was not measured
  double refined_bound = 0.0;   ///< [m] the same of what was measured, to within the tolerance
  double outside_bound = 0.0;   ///< [m] every place that is nearer to an obstacle is outside
  double region_bound = 0.0;    ///< [m] no point outside the regions of interest is nearer
  double rounding = 0.0;        ///< [m] largest error of a lower bound of the searches
  double max_coordinate = 0.0;  ///< [m] of the link in the frames of the indices
  double drift = 0.0;           ///< of the pose as given, see RigidPose
  double index_error = 0.0;     ///< [m] by the poses of maps as given, within range
  bool is_complete = false;     ///< nothing that matters was left
};

/// The part that is kept from one query to the next. It speeds queries up and never changes what an
/// answer promises.
struct LinkCoherence {
  explicit LinkCoherence(const LinkModel& link)
      : bound(link), extents(link), side_balls(!link.solid.is_closed()) {}

  LinkBound bound;
  ExtentBound extents;
  SearchFronts fronts;
  SideBalls side_balls;
  SupportingPlane plane;
  /// The obstacle of the last answer: evaluated at the new pose, it is the first upper bound.
  struct {
    std::uint64_t build_id = 0;  ///< of its index; 0: there was no answer
    ObstacleId id;
    Eigen::Vector3d p_LCl = Eigen::Vector3d::Zero();  ///< [m] closest point of the link
    bool has_place = false;                           ///< whether p_FCo is that of some answer
    Eigen::Vector3d p_FCo = Eigen::Vector3d::Zero();  ///< [m] closest point of the obstacle
    bool was_inside = false;                          ///< whether p_FCo was inside the link
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();  ///< pose of the link
  } last;
  /// The obstacle whose sphere was found nearest; build_id 0: none was.
  struct {
    std::uint64_t build_id = 0;
    ObstacleId id;
  } nearest_extent;
  /// The last complete answer: it is the same for the same question.
  struct {
    SceneId scene = kUnknownScene;                           ///< unknown: there is none
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();  ///< as it was asked
    QueryConfig config;
    SearchResult result;
  } answered;

  void forget() {
    last.build_id = 0;
    nearest_extent.build_id = 0;
    answered.scene = kUnknownScene;
    bound.forget();
    extents.forget();
    fronts.forget();
  }
};

/// The state of one query.
///
/// Branch and bound: `closest` holds the upper bound, and whatever is not measured exactly leaves
/// its lower bound in `pruned_bound`. So at any time no obstacle has a smaller signed distance than
/// lower_bound().
struct LinkSearch : SearchResult {
  // The question.
  Eigen::Isometry3d X_FL_given = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();  ///< the same, a rotation in double
  SceneId scene = kUnknownScene;
  QueryConfig config;
  double other_links = 0.0;   ///< [m] upper bound of other links, below which this one matters only
  bool has_extents = false;   ///< some obstacle has one
  double extent_range = 0.0;  ///< [m] largest radius of spheres in range
  double other_extents = 0.0;  ///< [m] as other_links, of spheres
  double width_share = 1.0;    ///< of the tolerance, that searches leave
  Goal goal = Goal::kTolerance;
  Deadline* deadline = nullptr;
  QueryStatistics* statistics = nullptr;

  bool is_answered = false;         ///< the question was the last one
  bool is_counted = false;          ///< in the statistics, as outside the regions
  double first_bound = 0.0;         ///< [m] proven for another goal
  double first_extent_bound = 0.0;  ///< [m] the same for spheres
  int box_cells_left = 0;           ///< into which overlapping boxes may still be divided
  int descent_steps_left = 0;  ///< of the search for a point inside where boxes only just overlap

  /// [m] Beyond it nothing matters.
  double range() const { return config.max_distance + config.margin + extent_range + rounding; }
  /// [m] How far below a distance its lower bound may be.
  double width(double distance) const {
    const double share = goal == Goal::kTolerance ? 0.0 : 0.5;
    return std::max(config.tolerance, std::max(config.relative_tolerance, share) * distance);
  }

  /// [m] A lower bound that is not below this cannot change the answer by more than the tolerance.
  /// @param share  of the tolerance, where more is to be proven than it asks for
  double prune_bound(double share = 1.0) const {
    if (goal == Goal::kFree) return std::min(kFreeBound, range());
    const double distance = std::min(closest.exact.distance, other_links);
    if (distance > range()) return range();
    // Whether any point is inside is always decided, however wide the tolerance. An obstacle that
    // only touches, at distance 0, does not decide it.
    return distance < 0.0 ? distance - share * config.tolerance
                          : std::max(distance - share * width(distance), 0.0);
  }
  /// [m] What a search proves, for lower bounds in float.
  float traversal_prune_bound() const { return round_up(prune_bound(width_share) + rounding); }

  /// Whether a search goes on.
  /// @param bound  [m] what is proven
  bool has_time(double bound) const {
    if (goal == Goal::kFree && bound > 0.0) return false;
    if (!deadline->passed()) return true;
    // The first turn is followed by an obstacle, which is worth more than a bound.
    const double distance = closest.exact.distance;
    const bool is_followed =
        goal == Goal::kFree && distance == std::numeric_limits<double>::infinity();
    return !(bound > 0.0) && distance > 0.0 && !is_followed && !deadline->passed_by(kFirstBounds);
  }
  void prune(double bound) { pruned_bound = std::min(pruned_bound, bound); }

  /// [m] No obstacle has a smaller signed distance; inf where none is in range.
  double lower_bound() const {
    return std::min({closest.exact.distance, refined_bound, pruned_bound});
  }
  /// [m] The same for the spheres that obstacles stand for.
  double extent_bound() const {
    return has_extents ? std::min(extents.lower_bound, lower_bound()) : lower_bound();
  }

  /// Takes an exact distance as the upper bound, if it is one. Obstacles out of range never are.
  template <class Bvh>
  void offer(const SignedDistance& exact, const Eigen::Vector3d& p_OQ,
             const PosedIndex<Bvh>& obstacles, ObstacleId id) {
    if (!(exact.distance < closest.exact.distance)) return;
    closest = {exact, obstacles.X_FO * p_OQ, obstacles.source, id, std::is_same_v<Bvh, BoxBvh>};
  }
};

/// The state of one link in a query: what never changes, what is kept from search to search, and
/// the present search. One thread.
struct LinkQueryState {
  explicit LinkQueryState(const LinkModel& link) : context(link), kept(link) {}

  LinkContext context;
  LinkCoherence kept;
  LinkSearch search;
};

/// Places the link's root sphere in the frame of an index. A mesh with holes may enclose places
/// beyond it, no farther than the interior gap.
inline void place_sphere(const LinkContext& link, const Eigen::Isometry3d& X_OL,
                         PlacedLink* placed) {
  const InnerSphereTree& tree = link.tree();
  const Eigen::Vector3d p_OC = X_OL * tree.center();
  for (int axis = 0; axis < 3; ++axis) placed->center[axis] = static_cast<float>(p_OC[axis]);
  placed->radius = round_up(tree.radius() + (link.solid().is_closed() ? 0.0 : tree.interior_gap()));
}

/// Places the link's supporting plane in the frame of an index.
inline void place_plane(const LinkQueryState& link, const Eigen::Isometry3d& X_OL,
                        PlacedLink* placed) {
  const SupportingPlane& plane = link.kept.plane;
  if (plane.normal_L.isZero()) return;
  const Eigen::Vector3d normal_O = X_OL.linear() * plane.normal_L;
  for (int axis = 0; axis < 3; ++axis) placed->normal[axis] = static_cast<float>(normal_O[axis]);
  placed->height =
      round_up(normal_O.dot(X_OL.translation()) + plane.support + link.search.rounding);
}

}  // namespace ist
