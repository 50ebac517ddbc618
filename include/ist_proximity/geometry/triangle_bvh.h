#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <vector>

#include "ist_proximity/geometry/triangle_mesh.h"

namespace ist {

/// The nearest point of a surface to a query point.
struct ClosestPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< in the frame of the query point
  double distance_sq = std::numeric_limits<double>::infinity();  ///< [m^2]; inf: none in range
  std::uint32_t triangle = 0;  ///< index into the mesh, valid when distance_sq is finite
};

/// Nearest point of triangle abc to p (Ericson, Real-Time Collision Detection, 5.1.5), also for
/// triangles of zero area.
Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Solid angle of triangle abc seen from p, divided by 4 pi (van Oosterom and Strackee, 1983);
/// positive when p sees the back of a counter-clockwise triangle.
double winding_of_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                           const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Bounding volume hierarchy over the triangles of one mesh: exact closest point, and the
/// generalized winding number (Jacobson et al. 2013) by a hierarchical expansion (Barill et al.
/// 2018). Immutable after construction; const members are thread safe and allocate nothing.
class TriangleBvh {
 public:
  TriangleBvh() = default;
  /// Keeps its own copy of the corners; triangles without area keep their place (a flap's edge is
  /// surface too).
  explicit TriangleBvh(const TriangleMesh& mesh);

  /// Nearest point of the surface within `max_distance_sq` [m^2] of p_M, exact in double.
  /// @returns distance_sq = inf when there is none.
  ClosestPoint closest(
      const Eigen::Vector3d& p_M,
      double max_distance_sq = std::numeric_limits<double>::infinity()) const;

  /// Generalized winding number at p_M: about 1 inside, 0 outside, in between near holes.
  /// Error below 0.01.
  double winding_number(const Eigen::Vector3d& p_M) const;

  /// As winding_number, several times faster; error below kQuickWindingError.
  double quick_winding_number(const Eigen::Vector3d& p_M) const;
  static constexpr double kQuickWindingError = 0.06;

  /// winding_number(p_M) > 0.5; evaluated without expansion where it would decide.
  bool is_inside(const Eigen::Vector3d& p_M) const;

  std::size_t size() const { return triangles_.size(); }
  Eigen::AlignedBox3d bounds() const { return nodes_.empty() ? Eigen::AlignedBox3d() : nodes_[0].box; }

 private:
  struct Triangle {
    Eigen::Vector3d a, b, c;
    std::uint32_t index;
  };
  struct Node {
    Eigen::AlignedBox3d box;
    std::uint32_t first = 0;  ///< leaf: first triangle; inner: index of the right child
    std::uint32_t count = 0;  ///< leaf: how many; inner: 0 (the left child is the next node)
    Eigen::Vector3d dipole_center = Eigen::Vector3d::Zero();
    Eigen::Vector3d dipole = Eigen::Vector3d::Zero();  ///< sum of area-weighted normals [m^2]
    Eigen::Matrix3d quadrupole = Eigen::Matrix3d::Zero();  ///< sum of (centroid - center) n^T [m^3]
    double radius = 0.0;  ///< [m] of the triangles about dipole_center
  };

  std::uint32_t build(std::uint32_t first, std::uint32_t last, int depth);
  void sum_moments(std::uint32_t node);
  double winding(const Eigen::Vector3d& p_M, double beta) const;

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

}  // namespace ist
