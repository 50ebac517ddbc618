#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "ist_proximity/geometry/box_distance.h"
#include "ist_proximity/geometry/triangle_mesh.h"

namespace ist {

/// The nearest point of a surface to a query point.
struct ClosestPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< in the frame of the query point
  double distance_sq = std::numeric_limits<double>::infinity();  ///< [m^2]; inf: none in range
  std::uint32_t triangle = 0;  ///< index into the mesh, valid when distance_sq is finite
  /// [m] No point of the surface is nearer; 0 where the search ended with `enough_sq`.
  double lower_bound = 0.0;
};

/// Nearest point of triangle abc to p (Ericson, Real-Time Collision Detection, 5.1.5), also for
/// triangles of zero area.
Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Bounding volume hierarchy over the triangles of one mesh: exact closest point, and generalized
/// winding number. Eight children or triangles are tested at a time in float; what survives is
/// evaluated in double. Immutable; const members are thread safe and allocate nothing.
class TriangleBvh {
 public:
  TriangleBvh() = default;
  /// Keeps its own copy of the corners; triangles without area keep their place (a flap's edge is
  /// surface too).
  explicit TriangleBvh(const TriangleMesh& mesh);

  /// Nearest point of the surface within `max_distance_sq` [m^2] of p_M, exact in double.
  /// @param toward_M   unit, about the way from the surface to p_M; a guess for speed, or zero
  /// @param enough_sq  [m^2] the first point found that is no farther than this will do
  /// @param slack      [m] a point that is not more than this farther than the nearest one will do,
  ///                   which is found sooner
  /// @returns distance_sq = inf when there is none.
  ClosestPoint closest(const Eigen::Vector3d& p_M,
                       double max_distance_sq = std::numeric_limits<double>::infinity(),
                       const Eigen::Vector3d& toward_M = Eigen::Vector3d::Zero(),
                       double enough_sq = 0.0, double slack = 0.0) const;

  /// The surface and a solid box: the nearest pair of points, exact in double, if nearer than
  /// `max_distance` [m]. 0 where the surface touches or crosses the box; a box that lies within a
  /// closed surface has a positive distance to it.
  /// @param box_O  axis-aligned in a frame O
  /// @param X_OM   the mesh's frame -> O
  BoxDistance closest_to_box(const Eigen::AlignedBox3d& box_O, const Eigen::Isometry3d& X_OM,
                             double max_distance) const;

  /// [m] How far the surface reaches along a direction: the largest n.x of its points; -inf without
  /// triangles.
  /// @param slack    [m] the result may be this much too large, which is found sooner
  /// @param reached  [m] what it is known to reach: the least that is returned
  double support(const Eigen::Vector3d& n_M, double slack = 0.0,
                 double reached = -std::numeric_limits<double>::infinity()) const;

  /// [m] How far beyond a sphere's centre the surface within the sphere reaches along a direction,
  /// at most: no point of it that is in the sphere has a larger n.(x - center). -inf where there is
  /// none; inf where that is more than `limit` [m]. Large triangles count as discs that end at the
  /// sphere.
  /// @param n_M  unit
  double support_within(const Eigen::Vector3d& center_M, double radius, const Eigen::Vector3d& n_M,
                        double limit) const;

  /// Generalized winding number (Jacobson et al. 2013) at p_M: about 1 inside, 0 outside, in
  /// between near holes. By a hierarchical expansion of second order (Barill et al. 2018); error
  /// below 0.01.
  double winding_number(const Eigen::Vector3d& p_M) const;

  /// As winding_number, several times faster; error below kQuickWindingError.
  double quick_winding_number(const Eigen::Vector3d& p_M) const;
  static constexpr double kQuickWindingError = 0.06;

  /// winding_number(p_M) > 0.5; evaluated with care where the quick one could be wrong.
  bool is_inside(const Eigen::Vector3d& p_M) const;

  std::size_t size() const { return triangles_.size(); }
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

  static constexpr std::size_t kWidth = 8;

  /// Boxes of up to eight children, rounded outward; unused slots are far away.
  struct alignas(32) Boxes {
    float min[3][kWidth], max[3][kWidth];  ///< [m] from the middle of the mesh's box
    std::int32_t child[kWidth];            ///< >= 0: node; < 0: leaf ~child
    std::int32_t count;                    ///< used slots, at the front
  };

  /// Slabs that hold the same children: what a box tells little of, a patch of surface aslant.
  struct alignas(32) Slabs {
    float low[kWidth], high[kWidth];   ///< of direction . x, x from the middle of the mesh's box
    std::int8_t direction[3][kWidth];  ///< about the mean normal, any length; zero: no slab
  };

  /// Expansions of the same children's winding numbers about their own centres.
  struct alignas(32) Moments {
    float x[kWidth], y[kWidth], z[kWidth];     ///< [m] centre
    float radius_sq[kWidth];                   ///< [m^2] of the triangles about the centre
    float nx[kWidth], ny[kWidth], nz[kWidth];  ///< [m^2] sum of area-weighted normals
    /// [m^3] symmetric part of the sum of (centroid - centre) normal^T
    float qxx[kWidth], qyy[kWidth], qzz[kWidth], qxy[kWidth], qxz[kWidth], qyz[kWidth];
  };

  /// Corners of up to eight triangles; unused slots repeat a corner.
  struct alignas(32) Leaf {
    float corner[9][kWidth];  ///< [m] ax ay az bx by bz cx cy cz
    std::uint32_t first;      ///< triangle of slot 0; the others follow
    std::uint32_t count;
  };

  /// The same triangles in double.
  struct Triangle {
    Eigen::Vector3d a, b, c;
    std::uint32_t index;  ///< in the mesh
  };

  /// What the kernels read.
  struct View {
    const Boxes* boxes;
    const Slabs* slabs;
    const Moments* moments;
    const Leaf* leaves;
    const Triangle* triangles;
    Eigen::Vector3d origin;  ///< middle of the mesh's box
    double radius;           ///< [m] half its diagonal
  };

 private:
  friend class TriangleBvhBuilder;
  View view() const;

  std::vector<Boxes> boxes_;      // by node; node 0 is the root
  std::vector<Slabs> slabs_;      // by node
  std::vector<Moments> moments_;  // by node
  std::vector<Leaf> leaves_;
  std::vector<Triangle> triangles_;
  Eigen::AlignedBox3d bounds_;
};

}  // namespace ist
