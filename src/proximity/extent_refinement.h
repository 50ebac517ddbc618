#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "ist_proximity/cloud/point_extent.h"
#include "proximity/refinement.h"

namespace ist {

/// A cloud's extent for the queries of one link. Ranges are those of stored points, whose rounding
/// is in the radii.
struct LinkExtent {
  /// @param from_sensor  [m] of the centre of the link's bounding sphere
  /// @param link_radius  [m] of that sphere
  LinkExtent(const PointExtent& extent, double from_sensor, double link_radius)
      : points(extent), farthest_part(from_sensor + link_radius) {}

  static constexpr double kRangeError = 1e-6;
  const PointExtent& points;
  double farthest_part;  ///< [m] no point of the link is farther from the sensor

  /// [m] The radius of a stored point, whose range is rounded.
  double radius(double range) const { return points.radius(range + kRangeError * (1.0 + range)); }
  double largest_radius() const {
    if (points.linear == 0.0 && points.quadratic == 0.0) return points.constant;
    return radius(points.max_range * (1.0 + kRangeError));
  }

  /// [m] No sphere that is nearer to the link than `limit` has a larger radius: its point is within
  /// limit + radius of the link, and so in range.
  double largest_radius_within(double limit) const {
    if (points.linear == 0.0 && points.quadratic == 0.0) return points.constant;
    double largest = largest_radius();
    for (int i = 0; i < 3; ++i) {
      const double range = farthest_part + std::max(limit + largest, 0.0);
      if (range < points.max_range) largest = std::min(largest, radius(range));
    }
    return largest;
  }

  /// [m] Where no point is nearer to the link than `distance`, no sphere is nearer than that less
  /// this, however far out: distances grow faster than radii.
  double largest_radius_beyond(double distance) const {
    const double range = farthest_part + std::max(distance, 0.0);
    return range < points.max_range ? radius(range) : largest_radius();
  }
};

/// The search for the sphere that is nearest to a link, of those that stand for the points of all
/// indices (PointExtent): branch and bound, as for the points themselves. No point is inside the
/// link.
struct ExtentSearch {
  double upper = std::numeric_limits<double>::infinity();        ///< [m] some sphere is that near
  double other_links = std::numeric_limits<double>::infinity();  ///< [m] a sphere of other links
  double range = 0.0;                                            ///< [m] beyond it nothing matters
  double width = 0.0;                                            ///< [m] tolerance
  double points_bound = 0.0;                                 ///< [m] no point is nearer than this
  double refined = std::numeric_limits<double>::infinity();  ///< [m] least bound of what was met

  /// [m] No sphere that is farther matters.
  double limit() const { return std::min({upper, other_links, range}); }
  /// [m] A bound that is not below this need not be better.
  double prune_bound() const {
    const double nearest = std::min(upper, other_links);
    return nearest > range ? range : nearest - width;
  }
};

/// Measures points of an index exactly, less their radius: the refinement policy of the dual-tree
/// traversal with extents. Functions neither allocate nor throw.
class PointExtentRefinement {
 public:
  static constexpr bool kHasExtent = true, kBoundsPoints = false;

  PointExtentRefinement(const PointObstacles& obstacles, const LinkExtent& extent,
                        LinkQueryState* link, ExtentSearch* search);

  float largest_radius(std::int32_t slot, const float* min, const float* max) const {
    if (slot < 0) return largest_radius_;
    double sum_sq = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double farthest = std::max(std::abs(static_cast<double>(min[i]) - p_OS_[i]),
                                       std::abs(static_cast<double>(max[i]) - p_OS_[i]));
      sum_sq += farthest * farthest;
    }
    const double range = std::min(std::sqrt(sum_sq), extent_.points.max_range);
    return round_up(extent_.radius(range) + rounding_);
  }
  float bound_box(std::int32_t slot, std::int32_t child, const float* min, const float* max);
  static bool is_outside(std::int32_t /*tile*/, int /*lane*/) { return true; }
  static bool leaves_inside() { return true; }
  float refine(std::int32_t tile, int lane, float lower_bound);
  bool update_planes(SupportingPlanes* planes) { return points_.update_planes(planes); }
  bool deadline_passed() { return link_.search.deadline->passed(); }
  static bool is_crowded(std::uint64_t /*node_pairs*/) { return false; }

  /// Measures the sphere about a point.
  void measure(ObstacleId id);
  /// [m] in float, for the traversal
  float traversal_prune_bound() const {
    return round_up(search_.prune_bound() + link_.search.rounding);
  }

 private:
  double radius(const Eigen::Vector3d& p_OQ) const { return extent_.radius((p_OQ - p_OS_).norm()); }
  void measure(ObstacleId id, const Eigen::Vector3d& p_OQ, const Eigen::Vector3d& p_LQ);

  const PointObstacles& obstacles_;
  const LinkExtent& extent_;
  LinkQueryState& link_;
  ExtentSearch& search_;
  PointRefinement points_;
  Eigen::Vector3d p_OS_;  ///< [m] the sensor
  double rounding_;       ///< [m] of the traversal where it adds or subtracts a radius
  float largest_radius_;  ///< [m] of all points
};

/// The same for boxes, which have one extent in common.
class BoxExtentRefinement {
 public:
  static constexpr bool kHasExtent = true, kBoundsPoints = false;

  BoxExtentRefinement(const BoxObstacles& obstacles, double extent, LinkQueryState* link,
                      ExtentSearch* search);

  float largest_radius(std::int32_t /*slot*/, const float* /*min*/, const float* /*max*/) const {
    return largest_radius_;
  }
  static float bound_box(std::int32_t /*slot*/, std::int32_t /*child*/, const float* /*min*/,
                         const float* /*max*/) {
    return -std::numeric_limits<float>::infinity();
  }
  static bool is_outside(std::int32_t /*tile*/, int /*lane*/) { return true; }
  static bool leaves_inside() { return true; }
  float refine(std::int32_t tile, int lane, float lower_bound);
  bool update_planes(SupportingPlanes* planes) {
    return update_supporting_planes(obstacles_.X_OL, &link_, planes);
  }
  bool deadline_passed() { return link_.search.deadline->passed(); }
  static bool is_crowded(std::uint64_t /*node_pairs*/) { return false; }

  /// Measures a box.
  void measure(ObstacleId id);
  /// [m] in float, for the traversal
  float traversal_prune_bound() const {
    return round_up(search_.prune_bound() + link_.search.rounding);
  }

 private:
  const BoxObstacles& obstacles_;
  double extent_;
  LinkQueryState& link_;
  ExtentSearch& search_;
  float largest_radius_;
};

}  // namespace ist
