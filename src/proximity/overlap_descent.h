#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>

namespace ist {

/// Looks for the deepest point of a box inside a convex solid, by cutting planes (Kelley 1960): the
/// signed distance is convex and hence above its tangent planes at the points measured so far, and
/// the next point to measure is about the least point of the largest of those planes. Neither
/// allocates nor throws.
class OverlapDescent {
 public:
  /// So many points are measured, at most.
  static constexpr std::size_t kMaxPoints = 32;

  /// @param box    in frame O
  /// @param start  [m] the first point, in the box
  OverlapDescent(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& start)
      : box_(box), point_(start) {}

  /// The point to measure now, in the box.
  const Eigen::Vector3d& point() const { return point_; }
  bool is_finished() const { return count_ == kMaxPoints; }
  /// Takes the signed distance at point() and its gradient, and moves on.
  /// @param normal_O  of unit length, in frame O
  void take(double distance, const Eigen::Vector3d& normal_O);

 private:
  struct Plane {
    Eigen::Vector3d normal;
    double offset;
  };
  const Plane& highest(const Eigen::Vector3d& p, double* value) const;

  Eigen::AlignedBox3d box_;
  Eigen::Vector3d point_;
  std::array<Plane, kMaxPoints> planes_;
  std::size_t count_ = 0;
};

}  // namespace ist
