#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "internal/bvh/traversal_stack.h"
#include "internal/geometry/box_distance.h"
#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// The closest point of a surface to a query point.
struct ClosestPoint {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< [m] in the frame of the query point
  double distance_sq = std::numeric_limits<double>::infinity();  ///< [m^2] inf: none in range
  std::uint32_t triangle = 0;  ///< index into the mesh, valid when distance_sq is finite
  std::uint32_t slot = 0;      ///< the same for TriangleBvh::triangle()
  /// [m] lower bound of the distance to the surface; 0 where the search ended early
  double lower_bound = 0.0;
};

/// Bounding volume hierarchy over the triangles of one mesh, in the mesh's frame M: exact closest
/// point, support function and generalized winding number. Eight children or triangles are tested
/// at a time in float; the candidates that remain are evaluated in double. Immutable; const members
/// are thread safe and allocate nothing.
class TriangleBvh {
 public:
  TriangleBvh() = default;
  /// Copies the corners. Triangles without area are kept: the edge of a flap is surface too.
  explicit TriangleBvh(const TriangleMesh& mesh) : TriangleBvh(mesh, CancelRequest()) {}
  /// The same; building a million triangles takes about a second.
  /// @throws Cancelled
  TriangleBvh(const TriangleMesh& mesh, const CancelRequest& cancelled);

  /// The closest point of the surface within `max_distance_sq` [m^2] of p_M, exact in double.
  /// @param outward_hint_M  unit vector, roughly the direction from the closest point to p_M; it
  ///                        affects the speed alone. Zero: none
  /// @param early_out_sq    [m^2] the first point found that is no farther than this is returned
  /// @param tolerance       [m] a point farther than the closest one by no more than this may be
  ///                        returned, which is found sooner
  /// @returns distance_sq = inf when there is none
  ClosestPoint closest(const Eigen::Vector3d& p_M,
                       double max_distance_sq = std::numeric_limits<double>::infinity(),
                       const Eigen::Vector3d& outward_hint_M = Eigen::Vector3d::Zero(),
                       double early_out_sq = 0.0, double tolerance = 0.0) const;

  /// The closest pair of points of the surface and a solid box, exact in double, if nearer than
  /// `max_distance` [m]. The distance is 0 where the surface touches or crosses the box; a box
  /// that lies within a closed surface has a positive distance to it.
  /// @param box_O  axis-aligned in a frame O
  /// @param X_OM   the mesh's frame -> O
  /// @param near_O  [m] if given, a place that the closest point of the surface may be near, such
  /// as
  ///                that of another pose: it is found sooner
  BoxDistance closest_to_box(const Eigen::AlignedBox3d& box_O, const Eigen::Isometry3d& X_OM,
                             double max_distance,
                             const std::optional<Eigen::Vector3d>& near_O = std::nullopt) const;

  /// [m] The support function: the largest n.x of the surface's points; -inf without triangles.
  /// @param tolerance  [m] the result may be this much too large, which is found sooner
  /// @param at_least   [m] a known lower bound of the support; nothing smaller is returned
  double support(const Eigen::Vector3d& n_M, double tolerance = 0.0,
                 double at_least = -std::numeric_limits<double>::infinity()) const;

  /// [m] An upper bound of the support of the surface within a sphere, measured from the sphere's
  /// centre: no point x of the surface in the sphere has a larger n.(x - center). A triangle counts
  /// as no more than the disc that its plane cuts out of the sphere.
  /// @param n_M        unit
  /// @param tolerance  [m] the result may be this much too large, which is found sooner
  /// @param at_least   [m] a lower bound of the support, if one is known; nothing smaller is
  ///                   returned
  /// @returns `at_least` where no surface is in the sphere
  double support_in_sphere(const Eigen::Vector3d& center_M, double radius,
                           const Eigen::Vector3d& n_M, double tolerance = 0.0,
                           double at_least = -std::numeric_limits<double>::infinity()) const;

  /// The generalized winding number (Jacobson et al. 2013) at p_M: about 1 inside, 0 outside, in
  /// between near holes. It is computed by a hierarchical expansion of second order (Barill et al.
  /// 2018) with an error below 0.01, and more where many sheets overlap.
  double winding_number(const Eigen::Vector3d& p_M) const;

  /// The same, several times faster, with a larger error.
  /// @param error  null, or receives what the error stays below: kQuickWindingError of the sum of
  ///               the expansion's terms without their signs, which is 1 about in a simple closed
  ///               surface and more where several sheets overlap
  double quick_winding_number(const Eigen::Vector3d& p_M, double* error = nullptr) const;
  static constexpr double kQuickWindingError = 0.08;

  /// winding_number(p_M) > 0.5. The quick winding number decides where its error allows it.
  bool is_inside(const Eigen::Vector3d& p_M) const;

  /// A crossing of a ray with the surface.
  struct RayCrossing {
    double t = std::numeric_limits<double>::infinity();  ///< parameter of the ray; inf: none
    std::uint32_t slot = 0;                              ///< for triangle(), valid when t is finite
  };
  /// The crossing with the smallest t in [0, max_t] of the ray origin + t direction, from either
  /// side of the surface. A ray along the plane of a triangle does not cross it.
  RayCrossing first_crossing(const Eigen::Vector3d& origin_M, const Eigen::Vector3d& direction_M,
                             double max_t = std::numeric_limits<double>::infinity()) const;

  std::size_t size() const { return triangles_.size(); }
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }

  /// Children of a node and triangles of a leaf, at most.
  static constexpr std::size_t kWidth = 8;
  /// Levels of inner nodes, at most: each level divides its triangles by eight, and a mesh has no
  /// more than 2^32 of them.
  static constexpr std::size_t kMaxLevels = 10;
  template <typename Entry>
  using Stack = TraversalStack<Entry, stack_capacity(kMaxLevels, kWidth)>;

  /// Boxes of up to eight children, rounded outward; unused slots are far away.
  struct alignas(32) Boxes {
    float min[3][kWidth], max[3][kWidth];  ///< [m] from the centre of the mesh's bounding box
    std::int32_t child[kWidth];            ///< >= 0: node; < 0: leaf ~child
    std::int32_t count;                    ///< used slots, at the front
  };

  /// Slabs that hold the same children. A slab is much tighter than the box about a patch of
  /// surface that is oblique to the axes.
  struct alignas(32) Slabs {
    float low[kWidth], high[kWidth];   ///< of direction.x, x from the centre of the bounding box
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

  /// Corners of up to eight triangles in float; unused slots repeat a corner.
  struct alignas(32) Leaf {
    /// [m] ax ay az bx by bz cx cy cz, from the centre of the box; a is opposite the longest edge
    float corner[9][kWidth];
    std::uint32_t first;  ///< triangle of slot 0; the others follow
    std::uint32_t count;
  };

  /// The same triangles in double, their corners in the same order.
  struct Triangle {
    Eigen::Vector3d a, b, c;
    std::uint32_t index;  ///< in the mesh

    /// Unit, by the order of the corners; zero for a triangle without area.
    Eigen::Vector3d normal() const { return (b - a).cross(c - a).normalized(); }
  };

  /// A leaf and its box [m] from the centre of the mesh's bounding box.
  struct RayLeaf {
    float min[3], max[3];
    std::uint32_t leaf;
  };
  /// Finds the leaves that a ray origin + t direction with t in [0, max_t] may cross, whichever of
  /// the directions it has; roughly the one that is entered first comes first.
  /// @param directions_M  holds them; corners of it that are no direction of a ray do no harm
  /// @param leaves        receives them
  /// @returns how many leaves there are; more than `capacity`: they do not fit, and the search
  ///          ended
  std::size_t leaves_on_rays(const Eigen::Vector3d& origin_M,
                             const Eigen::AlignedBox3d& directions_M, double max_t, RayLeaf* leaves,
                             std::size_t capacity) const;

  /// The directions of sixteen rays, as columns.
  using Directions = Eigen::Matrix<double, 3, 16>;
  /// first_crossing() of some of these rays, all of which begin at one point.
  /// @param leaves     of leaves_on_rays()
  /// @param rays       bit k: ray k is asked about. The others' numbers below are not used
  /// @param max_t      by ray
  /// @param crossings  receives them, by ray
  void first_crossings(const RayLeaf* leaves, std::size_t count, const Eigen::Vector3d& origin_M,
                       const Directions& directions_M, std::uint32_t rays,
                       const std::array<double, 16>& max_t,
                       std::array<RayCrossing, 16>* crossings) const;

  /// [bytes] of the hierarchy and its triangles.
  std::size_t memory() const {
    return boxes_.capacity() * sizeof(Boxes) + slabs_.capacity() * sizeof(Slabs) +
           moments_.capacity() * sizeof(Moments) + leaves_.capacity() * sizeof(Leaf) +
           triangles_.capacity() * sizeof(Triangle);
  }

  /// A triangle by its place in the hierarchy.
  const Triangle& triangle(std::uint32_t slot) const { return triangles_[slot]; }

  /// The arrays that the SIMD kernels read.
  struct View {
    const Boxes* boxes;      ///< by node; node 0 is the root
    const Slabs* slabs;      ///< by node
    const Moments* moments;  ///< by node
    const Leaf* leaves;
    const Triangle* triangles;
    Eigen::Vector3d origin;  ///< [m] centre of the mesh's bounding box
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
