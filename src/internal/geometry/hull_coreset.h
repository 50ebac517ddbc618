#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/convex_part.h"
#include "ist_proximity/geometry/span.h"

namespace ist {

/// A coreset of the convex hull of a surface (Agarwal, Har-Peled and Varadarajan 2004): some of its
/// corners, whose hull is proven to come within `error()` of all others. Its support function is
/// that of the surface, less at most that error, and takes tens of nanoseconds. Of a sphere alone
/// it is the centre, and the error is the radius in every direction. Immutable; const members are
/// thread safe and allocate nothing.
class HullCoreset {
 public:
  HullCoreset() = default;
  /// Takes some milliseconds for ten thousand triangles. Of round parts it takes points of their
  /// surface, so many that error() is about 3e-4 of a cylinder's radius and 3e-3 of that of a
  /// sphere beside other parts.
  /// @param max_points  in the coreset, at least 32
  /// @throws Cancelled  soon after `cancelled` returned true
  explicit HullCoreset(Span<const ConvexPart> parts, const CancelRequest& cancelled = {},
                       std::size_t max_points = 2048);

  bool empty() const { return points_.empty(); }
  std::size_t size() const { return points_.size(); }
  /// [m] For unit n, no point x of the surface has n.x > n.point(farthest(n)) + error().
  double error() const { return error_; }
  /// The index of the point that is farthest along a direction, to rounding. Not to be called where
  /// there is none.
  std::uint32_t farthest(const Eigen::Vector3d& n) const;
  /// The same in double: slower, for the last digits.
  std::uint32_t farthest_in_double(const Eigen::Vector3d& n) const;
  const Eigen::Vector3d& point(std::uint32_t index) const { return points_[index]; }  ///< [m]
  /// [m] The surface's hull is no farther from a point. Not to be called where there is no point.
  double distance_at_most(const Eigen::Vector3d& p) const;

 private:
  class Builder;
  void take_sphere(const ConvexPart& sphere);
  Eigen::Vector3d offset(const Eigen::Vector3d& p, std::uint32_t* point_index) const;
  void add(const Eigen::Vector3d& point);

  std::vector<Eigen::Vector3d> points_;
  std::vector<float> lanes_;  // x of all points, then y, then z, each filled up with the first
  double error_ = 0.0;
};

/// The number of floats of one coordinate of so many points.
constexpr std::size_t coreset_lanes(std::size_t points) {
  constexpr std::size_t kWidth = 16;
  return (points + kWidth - 1) / kWidth * kWidth;
}

/// The index of the largest n.p of points that lie in lanes: `count` x, as many y, as many z.
/// @param count  a multiple of 16
std::uint32_t farthest_of_lanes(const float* lanes, std::size_t count, const float n[3]);

}  // namespace ist
