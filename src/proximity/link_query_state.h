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
#include "proximity/box_bounds.h"
#include "proximity/boxes_inside.h"
#include "proximity/coherence/box_distance_cache.h"
#include "proximity/coherence/bvtt_front.h"
#include "proximity/coherence/distance_cache.h"
#include "proximity/coherence/extent_bound.h"
#include "proximity/coherence/field_front.h"
#include "proximity/coherence/link_bound.h"
#include "proximity/coherence/node_bounds.h"
#include "proximity/coherence/side_balls.h"
#include "proximity/posed_index.h"
#include "proximity/signed_distance_grid.h"
#include "proximity/supporting_planes.h"
#include "proximity/visited_set.h"

/// The state of a link's query: three types, by how long their content lives.
namespace ist {

/// [m] More than double loses where distances are compared.
inline constexpr double kDistanceRounding = 1e-12;

/// The part that belongs to the link for ever, whatever its pose and whatever the clouds.
struct LinkContext {
  explicit LinkContext(const LinkModel& link) : model(&link), displacement(link), grid(link) {}

  const LinkModel* model;
  DisplacementBound displacement;
  SignedDistanceGrid grid;

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
  double cover_bound = 0.0;     ///< [m] no point is nearer to the clipped cover spheres
  double region_bound = 0.0;    ///< [m] no point outside the regions of interest is nearer
  double rounding = 0.0;        ///< [m] largest error of a lower bound of the traversals
  double max_coordinate = 0.0;  ///< [m] of the link in the frames of the indices
  double drift = 0.0;           ///< of the pose as given, see RigidPose
  double index_error = 0.0;     ///< [m] by the poses of maps as given, within range
  bool is_complete = false;     ///< nothing that matters was left
};

/// The part that is kept from one query to the next. It speeds queries up and never changes what an
/// answer promises.
struct LinkCoherence {
  explicit LinkCoherence(const LinkModel& link)
      : bound(link),
        extents(link),
        nodes(link),
        side_balls(!link.solid.is_closed()),
        supports(link.tree) {}

  LinkBound bound;
  ExtentBound extents;
  NodeBounds nodes;
  BvttFronts fronts;
  FieldFronts field_fronts;
  DistanceCache distances;
  BoxDistanceCache box_distances;
  SideBalls side_balls;
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
  /// [m] The distance at which too many points were about equally near for the dual-tree traversal;
  /// inf: none.
  double crowded_at = std::numeric_limits<double>::infinity();
  /// [m] The distance at which the field search gave up; inf: nowhere.
  double too_coarse_at = std::numeric_limits<double>::infinity();
  /// The last complete answer: it is the same for the same question.
  struct {
    SceneId scene = kUnknownScene;                           ///< unknown: there is none
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();  ///< as it was asked
    QueryConfig config;
    SearchResult result;
  } answered;
  /// The scene and the pose that a first bound was looked for in.
  struct {
    SceneId scene = kUnknownScene;  ///< unknown: nowhere
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    bool was_proven = false;  ///< whether one was found
    bool by_planes = false;   ///< with as many planes as it takes, too
  } first_bound;
  SupportCache supports;
  Eigen::Vector3d plane_normal_L = Eigen::Vector3d::Zero();  ///< of `supports`; zero: none yet

  void forget() {
    last.build_id = 0;
    nearest_extent.build_id = 0;
    answered.scene = kUnknownScene;
    first_bound.scene = kUnknownScene;
    bound.forget();
    extents.forget();
    nodes.forget();
    fronts.forget();
    field_fronts.forget();
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
  Deadline* deadline = nullptr;
  QueryStatistics* statistics = nullptr;

  bool is_answered = false;         ///< the question was the last one
  bool is_counted = false;          ///< in the statistics, as outside the regions
  double first_bound = 0.0;         ///< [m] proven before tighten()
  double first_extent_bound = 0.0;  ///< [m] the same for spheres
  BoxBounds box_bounds;
  VisitedSet visited;          ///< obstacles of the index at work that were refined
  VisitedSet outside;          ///< boxes of the index at work that are outside the link
  BoxesInside boxes_inside;    ///< of the index at work
  int measured = 0;            ///< points
  int refined = 0;             ///< points, in the dual-tree traversal at work
  int box_cells_left = 0;      ///< into which overlapping boxes may still be divided
  int descent_steps_left = 0;  ///< of the search for a point inside where boxes only just overlap

  /// [m] Beyond it nothing matters.
  double range() const { return config.max_distance + config.margin + extent_range + rounding; }
  /// [m] How far below a distance its lower bound may be.
  double width(double distance) const {
    return std::max(config.tolerance, config.relative_tolerance * distance);
  }

  /// [m] A lower bound that is not below this cannot change the answer by more than the tolerance.
  double prune_bound() const {
    const double distance = std::min(closest.exact.distance, other_links);
    if (distance > range()) return range();
    // Whether any point is inside is always decided, however wide the tolerance. An obstacle that
    // only touches, at distance 0, does not decide it.
    return distance < 0.0 ? distance - config.tolerance : std::max(distance - width(distance), 0.0);
  }
  /// [m] The same for lower bounds in float.
  float traversal_prune_bound() const { return round_up(prune_bound() + rounding); }

  void count_exact() {
    ++measured;
    ++statistics->exact_evaluations;
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

/// The three of one link. One thread.
struct LinkQueryState {
  explicit LinkQueryState(const LinkModel& link) : context(link), kept(link) {}

  LinkContext context;
  LinkCoherence kept;
  LinkSearch search;
};

}  // namespace ist
