#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>

#include "internal/geometry/solid_queries.h"
#include "proximity/link_query_state.h"
#include "proximity/search_queue.h"

/// The measures of a Search: they measure the obstacles of an index exactly. Results go to
/// LinkSearch. Functions neither allocate nor throw.
namespace ist {

using SearchEntry = SearchQueue::Entry;

inline ObstacleId id_of(const SearchEntry& entry) { return {~entry.child, entry.lane}; }

/// The common part of measures of points and of boxes.
template <class Index>
class ObstacleMeasure {
 public:
  using Bvh = Index;
  static constexpr bool kHasExtent = false;

  ObstacleMeasure(const PosedIndex<Bvh>& obstacles, LinkQueryState* link)
      : obstacles_(obstacles), link_(*link) {}

  float traversal_prune_bound() const { return link_.search.traversal_prune_bound(); }
  bool deadline_passed() const { return link_.search.deadline->passed(); }
  /// Whether a search goes on whose least bound is this [m].
  bool has_time(float bound) const { return link_.search.has_time(static_cast<double>(bound)); }
  /// Turns the link's supporting plane across the direction of the closest obstacle.
  /// @param placed  receives it
  /// @returns whether it has changed
  bool turn_plane(PlacedLink* placed) const {
    if (!link_.kept.plane.turn_to(link_.context.solid(), link_.search.closest.exact)) return false;
    place_plane(link_, obstacles_.X_OL, placed);
    return true;
  }
  template <class Tile>
  static void take_extents(const Tile& /*tile*/, Bounds* /*bounds*/) {}

 protected:
  const PosedIndex<Bvh>& obstacles_;
  LinkQueryState& link_;
};

/// Measures points.
class PointMeasure : public ObstacleMeasure<PointBvh> {
 public:
  static constexpr bool kHasBoxes = false;
  using Side = NearSurface::Side;
  using ObstacleMeasure::ObstacleMeasure;

  /// Measures a point that is known to be outside, and no farther than its radius.
  /// @returns [m] a lower bound of its distance
  float measure_outside(const SearchEntry& point, float rounding);
  /// Measures a point that is known to be inside, if it may be the deepest.
  /// @returns [m] a lower bound of its signed distance
  float measure_inside(const SearchEntry& point, float rounding);
  /// On which side of the link's surface a point is, and which places about it are, too, by what
  /// was decided in this and in other queries.
  SideBalls::Found known_side(const SearchEntry& point) const;
  /// The same, decided now; unknown after the deadline. The margin may be 0.
  /// @param least_distance  [m] no part of the surface is nearer, as far as it is known
  SideBalls::Found ask_side(const SearchEntry& point, float least_distance);
  /// Whether the surface is known to be within a distance of a point, for links of one mesh.
  bool is_surface_within(const SearchEntry& point, float distance) const;

  /// Measures a point that may be inside.
  /// @param max_distance  [m] what its distance is known not to exceed, or does not matter beyond
  void measure(ObstacleId id, double max_distance = std::numeric_limits<double>::infinity());

 private:
  SideBalls::Found side(const Eigen::Vector3d& p_LQ, double least_distance);
  Side cheapest_side(const Eigen::Vector3d& p_LQ, double* max_distance);
  double measure_outside(ObstacleId id, const Eigen::Vector3d& p_OQ, const Eigen::Vector3d& p_LQ,
                         double max_distance);
  double measure_inside(ObstacleId id, const Eigen::Vector3d& p_OQ, const Eigen::Vector3d& p_LQ,
                        double within);
};

/// Measures boxes. A box that overlaps the link is divided into parts, each of which is measured at
/// its centre: the signed distance of a part's points is no less than that less its radius.
class BoxMeasure : public ObstacleMeasure<BoxBvh> {
 public:
  static constexpr bool kHasBoxes = true;
  using ObstacleMeasure::ObstacleMeasure;

  /// Measures a box that is known to be outside.
  /// @returns [m] a lower bound of its distance
  float measure_outside(const SearchEntry& entry, float rounding);
  struct Found {
    bool is_outside;  ///< as a whole
    float bound;      ///< [m] no point of the box has a smaller signed distance
  };
  /// Measures a box that may be inside.
  /// @param entry  its `distance` becomes a lower bound of the distance to the surface
  Found measure_box(SearchEntry* entry);
  /// Whether a part with this bound may hold a place so much deeper that it matters, and may still
  /// be divided.
  bool may_divide(float bound) const;
  /// Halves a box, or a part of one, across its longest edge, and measures the centres.
  /// @param halves  both are the whole
  /// @returns [m] lower bounds of their signed distances
  std::array<float, 2> divide(std::array<SearchEntry, 2>* halves);

  /// Measures a box that may be inside.
  /// @param max_distance  [m] a distance to the surface that it is known not to exceed
  /// @param near_O        [m] a place that the closest point of the link may be near
  void measure(ObstacleId id, double max_distance, const std::optional<Eigen::Vector3d>& near_O);
  /// Takes the signed distance of one point of a box.
  void take_point(const Eigen::Vector3d& p_OQ, ObstacleId id);

 private:
  double useful_distance() const;
  BoxDistance measure_distance(const Eigen::AlignedBox3d& box, double limit,
                               const std::optional<Eigen::Vector3d>& near_O = std::nullopt) const;
  bool is_outside(const Eigen::AlignedBox3d& box) const;
  float measure_part(const SearchEntry& entry);
  void take_outside(const BoxDistance& found, ObstacleId id);
  void take_overlap(const Eigen::AlignedBox3d& box, const BoxDistance& found, ObstacleId id);
  void descend(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p_OQ, ObstacleId id);
};

/// The measure of an index's obstacles.
template <class Obstacles>
struct MeasureOf;
template <>
struct MeasureOf<PointObstacles> {
  using Type = PointMeasure;
};
template <>
struct MeasureOf<BoxObstacles> {
  using Type = BoxMeasure;
};

}  // namespace ist
