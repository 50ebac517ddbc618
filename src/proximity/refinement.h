#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <optional>

#include "internal/geometry/solid_queries.h"
#include "proximity/dual_tree.h"
#include "proximity/link_query_state.h"

namespace ist {

/// Measures points of an index exactly: the refinement policy of the dual-tree traversal (see
/// search_dual_tree), and what warm starts use. Results go to LinkSearch. Functions neither
/// allocate nor throw.
class PointRefinement {
 public:
  static constexpr bool kHasExtent = false, kBoundsPoints = true;
  using Side = NearSurface::Side;

  PointRefinement(const PointObstacles& obstacles, LinkQueryState* link)
      : obstacles_(obstacles), link_(*link) {}

  /// Whether the link's grid proves a point to be outside, whose cover distance does not.
  /// [m] No point in a box of the BVH is nearer, and none inside; -inf: not known.
  /// @param slot   names the box in the BVH
  /// @param child  node, or tile if negative, that the box holds
  float bound_box(std::int32_t slot, std::int32_t child, const float* min, const float* max) {
    return bound_box(slot, child, min, max, link_.search.prune_bound());
  }
  /// @param enough  [m] a bound that is not below this need not be better
  float bound_box(std::int32_t slot, std::int32_t child, const float* min, const float* max,
                  double enough);
  bool is_outside(std::int32_t tile, int lane) {
    const ObstacleId id{tile, lane};
    const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id), p_LQ = obstacles_.X_LO * p_OQ;
    const Side found = side(id, p_LQ).side;
    if (found == Side::kInside) measure_inside(id, p_OQ, p_LQ);
    return found == Side::kOutside;
  }
  /// Points that are outside are told from others at once, or the rest is the depth search's.
  static bool leaves_inside() { return true; }
  float traversal_prune_bound() const { return link_.search.traversal_prune_bound(); }
  /// On which side of the link's surface a point is, and which places about it are, too; unknown
  /// after the deadline. The margin may be 0.
  /// @param least_distance  [m] no part of the surface is nearer, as far as it is known
  SideBalls::Found side(ObstacleId id, const Eigen::Vector3d& p_LQ, double least_distance = 0.0);
  SideBalls::Found ask_side(std::int32_t tile, int lane, float least_distance) {
    const ObstacleId id{tile, lane};
    return side(id, obstacles_.X_LO * point_O(*obstacles_.bvh, id),
                static_cast<double>(least_distance));
  }
  /// Whether the surface is known to be within a distance of a point, for links of one mesh.
  bool is_surface_within(std::int32_t tile, int lane, float distance);
  /// The side of a place, by what was decided in this and in other queries.
  SideBalls::Found known_side(const float p_LQ[3]) const {
    return link_.kept.side_balls.find(
        {static_cast<double>(p_LQ[0]), static_cast<double>(p_LQ[1]), static_cast<double>(p_LQ[2])});
  }
  /// The same for a point, by what is kept and by the link's grid: never inside.
  Side known_side(ObstacleId id, const Eigen::Vector3d& p_LQ);
  /// Measures a point that is outside the link, unless it was measured in this traversal or a kept
  /// bound proves that it does not matter.
  /// @param lower_bound  [m] by the clipped cover spheres
  /// @returns [m] the new prune bound
  float refine(std::int32_t tile, int lane, float lower_bound);
  /// Measures a point that is outside.
  /// @param max_distance  [m] what its distance does not exceed
  /// @returns [m] the new prune bound
  float measure_near(std::int32_t tile, int lane, float max_distance);
  /// [m] A lower bound of the distance of the point that refine() got last; -inf: none is known.
  float refined_bound() const { return refined_bound_; }
  bool has_holes() const { return !link_.context.solid().is_closed(); }
  /// Calls update_supporting_planes().
  bool update_planes(SupportingPlanes* planes);
  /// [m] The link's support along the normal of its supporting planes.
  float link_support() const { return link_.kept.supports.max_support; }
  bool deadline_passed() { return link_.search.deadline->passed(); }
  /// Whether so many points are about equally near that the single-tree traversal is better.
  bool is_crowded(std::uint64_t node_pairs) const;

  /// Measures a point that may be inside.
  /// @param max_distance  [m] what its distance is known not to exceed, or does not matter beyond
  void measure(ObstacleId id, double max_distance = std::numeric_limits<double>::infinity());
  /// Measures a point that is known to be outside.
  /// @param max_distance  as above
  /// @returns [m] a lower bound of its distance
  double measure_outside(ObstacleId id, const Eigen::Vector3d& p_OQ, const Eigen::Vector3d& p_LQ,
                         double max_distance = std::numeric_limits<double>::infinity());

  /// Measures a point that is known to be inside, if it may be the deepest.
  /// @param within  [m] some part of the surface is no farther
  void measure_inside(ObstacleId id, const Eigen::Vector3d& p_OQ, const Eigen::Vector3d& p_LQ,
                      double within = std::numeric_limits<double>::infinity());
  void measure_inside(std::int32_t tile, int lane, float within) {
    const ObstacleId id{tile, lane};
    const Eigen::Vector3d p_OQ = point_O(*obstacles_.bvh, id);
    measure_inside(id, p_OQ, obstacles_.X_LO * p_OQ, static_cast<double>(within));
  }

  /// By the link's grid; `enough` as above.
  SignedDistanceGrid::Bound grid_bound(const SignedDistanceGrid::Part& part, double enough);

 private:
  Side cheapest_side(ObstacleId id, const Eigen::Vector3d& p_LQ, double* max_distance);

  const PointObstacles& obstacles_;
  LinkQueryState& link_;
  float refined_bound_ = -std::numeric_limits<float>::infinity();
};

/// The same for solid boxes. While a box is outside the link, its distance is exact: triangle
/// against box, or primitive against box. A box that touches no triangle of a mesh is inside or
/// outside as a whole; if the mesh has holes, the winding number at the box's centre decides.
class BoxRefinement {
 public:
  static constexpr bool kHasExtent = false, kBoundsPoints = true;

  BoxRefinement(const BoxObstacles& obstacles, LinkQueryState* link)
      : obstacles_(obstacles), link_(*link) {}

  static float bound_box(std::int32_t /*slot*/, std::int32_t /*child*/, const float* /*min*/,
                         const float* /*max*/) {
    return -std::numeric_limits<float>::infinity();
  }
  static bool is_crowded(std::uint64_t /*node_pairs*/) { return false; }
  /// Whether a box, of which the cover distances say nothing, is wholly outside. Of a link with
  /// holes, the depth search decides; of a closed one, what may be inside is in boxes_inside.
  bool is_outside(std::int32_t tile, int lane);
  /// Whether the depth search looks at all boxes itself.
  bool leaves_inside() const { return has_holes() || !link_.search.boxes_inside.is_complete(); }
  bool has_holes() const { return !link_.context.solid().is_closed(); }
  /// [m] A lower bound of the distance of the box that refine() got last, if it is known to be
  /// outside a closed link; else -inf.
  float refined_bound() const { return refined_bound_; }
  float traversal_prune_bound() const { return link_.search.traversal_prune_bound(); }
  /// Does for a box what PointRefinement::refine() does for a point.
  float refine(std::int32_t tile, int lane, float lower_bound);
  bool update_planes(SupportingPlanes* planes);
  bool deadline_passed() { return link_.search.deadline->passed(); }

  /// Measures a box that may be inside.
  /// @param max_distance  [m] a distance to the surface that it is known not to exceed
  /// @param near_O        [m] a place that the closest point of the link may be near
  void measure(ObstacleId id, double max_distance = std::numeric_limits<double>::infinity(),
               const std::optional<Eigen::Vector3d>& near_O = std::nullopt);
  /// Takes the distance of a box that is outside, or does not touch the surface.
  void take_outside(const BoxDistance& found, ObstacleId id);
  /// Takes the signed distance of one point of a box.
  void take_point(const Eigen::Vector3d& p_OQ, ObstacleId id);
  /// Takes points of a box that has at least one in common with the link: that one, and some that
  /// are deeper.
  void take_overlap(const BoxDistance& found, ObstacleId id);
  /// Takes the point of a box that is deepest in a sphere of a leaf: there the depth is largest but
  /// for what the packing leaves open.
  void take_deepest_in_spheres(std::int32_t leaf, ObstacleId id);

 private:
  /// A box and what is kept of it.
  struct Visit {
    Visit(const BoxObstacles& obstacles, ObstacleId obstacle);
    ObstacleId id;
    Eigen::AlignedBox3d box;  // frame O
    std::uint32_t key;
    PlacedBox placed;
  };
  /// Measures a box and keeps its distance to the surface, as far as it matters.
  BoxDistance measure_distance(const Visit& visit, double limit, BoxDistanceCache::Kept* kept,
                               const std::optional<Eigen::Vector3d>& near_O = std::nullopt);
  /// Whether a box that the surface of a closed link does not meet is outside, by its centre.
  bool is_center_outside(const Visit& visit) const;
  bool is_far_from_cover(const Visit& visit) const;
  double useful_distance() const;
  void measure_outside(const Visit& visit, BoxDistanceCache::Kept* kept);
  void keep_outside(const Visit& visit, BoxDistanceCache::Kept* kept);
  /// Looks for a point of a box that is inside the link, from one that both have in common, while
  /// none is known.
  void descend(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p_OQ, ObstacleId id);

  const BoxObstacles& obstacles_;
  LinkQueryState& link_;
  float refined_bound_ = -std::numeric_limits<float>::infinity();
};

template <class Obstacles>
struct RefinementOf;
template <>
struct RefinementOf<PointObstacles> {
  using Type = PointRefinement;
};
template <>
struct RefinementOf<BoxObstacles> {
  using Type = BoxRefinement;
};
template <class Obstacles>
using Refinement = typename RefinementOf<Obstacles>::Type;

/// Chooses supporting planes across the direction of the closest obstacle, which touch the link
/// where it ends in that direction. Where the link is convex there, they touch the closest point,
/// and what lies beyond the obstacle's own plane is farther. They belong to the link and stay from
/// query to query while the direction is nearly the same.
/// @param X_OL    link -> the index's frame
/// @param planes  set when they have changed
/// @returns whether they have changed
bool update_supporting_planes(const Eigen::Isometry3d& X_OL, LinkQueryState* link,
                              SupportingPlanes* planes);

/// The planes that there are, in the index's frame.
SupportingPlanes supporting_planes(const Eigen::Isometry3d& X_OL, const LinkQueryState& link);

}  // namespace ist
