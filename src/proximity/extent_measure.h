#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "internal/geometry/float_rounding.h"
#include "ist_proximity/cloud/point_extent.h"
#include "proximity/obstacle_measure.h"

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

/// Measures the spheres that the obstacles of an index stand for: every bound is that of the
/// obstacle, less the radius. Obstacles are outside the link. Functions neither allocate nor throw.
template <class Obstacles>
class ExtentMeasure : public MeasureOf<Obstacles>::Type {
  using Base = typename MeasureOf<Obstacles>::Type;

 public:
  static constexpr bool kHasExtent = true;

  /// @param extent      of points
  /// @param box_extent  [m] of every box
  ExtentMeasure(const Obstacles& obstacles, const LinkExtent& extent, double box_extent,
                LinkQueryState* link, ExtentSearch* search)
      : Base(obstacles, link),
        extent_(extent),
        box_extent_(box_extent),
        search_(*search),
        p_OS_(obstacles.X_FO.inverse() * extent.points.p_FS),
        rounding_(kFloatRounding *
                  (link->search.range() + 2.0 * std::max(extent.largest_radius(), box_extent))) {}

  float traversal_prune_bound() const {
    return round_up(search_.prune_bound() + this->link_.search.rounding);
  }
  /// The plane bounds obstacles, not their spheres.
  static bool turn_plane(PlacedLink* /*placed*/) { return false; }

  void take_extents(const PointTile& tile, Bounds* bounds) const {
    for (int k = 0; k < tile.count; ++k) take(radius(tile.point(k)), k, bounds);
  }
  void take_extents(const BoxRows& boxes, Bounds* bounds) const {
    for (int k = 0; k < boxes.count; ++k) take(largest_radius(boxes, k), k, bounds);
  }

  /// Measures the sphere about an obstacle.
  /// @returns [m] a lower bound of its distance
  float measure_outside(const SearchEntry& entry, float /*rounding*/) {
    return round_down(measure(id_of(entry)));
  }
  double measure(ObstacleId id) {
    LinkSearch& search = this->link_.search;
    ++search.statistics->exact_evaluations;
    const double r = radius_of(id), limit = std::max(search_.limit() + r + search.rounding, 0.0);
    const auto [distance, lower_bound] = distance_of(id, limit);
    const double bound = std::max(lower_bound, search_.points_bound) - r;
    search_.refined = std::min(search_.refined, bound);
    if (distance - r < search_.upper) {
      search_.upper = distance - r;
      this->link_.kept.nearest_extent = {this->obstacles_.bvh->build_id(), id};
    }
    return bound;
  }

 private:
  // The search subtracts a radius once for each bound, in float.
  static constexpr double kFloatRounding = 2.4e-7;

  double radius(const Eigen::Vector3d& p_OQ) const { return extent_.radius((p_OQ - p_OS_).norm()); }
  double radius_of(ObstacleId id) const {
    if constexpr (Base::kHasBoxes) {
      return box_extent_;
    } else {
      return radius(point_O(*this->obstacles_.bvh, id));
    }
  }
  // The radius of the place that is farthest from the sensor.
  double largest_radius(const BoxRows& boxes, int k) const {
    if (Base::kHasBoxes) return box_extent_;
    double sum_sq = 0.0;
    for (int i = 0; i < 3; ++i) {
      const double farthest = std::max(std::abs(static_cast<double>(boxes.min[i][k]) - p_OS_[i]),
                                       std::abs(static_cast<double>(boxes.max[i][k]) - p_OS_[i]));
      sum_sq += farthest * farthest;
    }
    return extent_.radius(std::min(std::sqrt(sum_sq), extent_.points.max_range));
  }
  void take(double r, int k, Bounds* bounds) const {
    const float by_point =
        bounds->outside[k] > 0.0F ? bounds->distance[k] : std::max(bounds->surface[k], 0.0F);
    const float least = std::max(by_point, round_down(search_.points_bound));
    bounds->distance[k] = least - round_up(r + rounding_);
    bounds->outside[k] = kFarAway;
  }
  struct Distance {
    double distance, lower_bound;
  };
  Distance distance_of(ObstacleId id, double limit) const {
    const Solid& solid = this->link_.context.solid();
    if constexpr (Base::kHasBoxes) {
      const BoxDistance found =
          distance_to_box(solid, box_O(*this->obstacles_.bvh, id), this->obstacles_.X_OL, limit);
      return {found.distance, found.lower_bound};
    } else {
      double lower_bound;
      const SignedDistance exact =
          distance_outside(solid, this->obstacles_.X_LO * point_O(*this->obstacles_.bvh, id), limit,
                           this->link_.kept.plane.normal_L, 0.0, &lower_bound);
      return {exact.distance, lower_bound};
    }
  }

  const LinkExtent& extent_;
  double box_extent_;
  ExtentSearch& search_;
  Eigen::Vector3d p_OS_;  ///< [m] the sensor
  double rounding_;       ///< [m] of the search where it subtracts a radius
};

}  // namespace ist
