#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <optional>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/geometry/triangle_bvh.h"

namespace ist {

/// Exact signed distance from a point to a solid.
struct SignedDistance {
  double distance = std::numeric_limits<double>::infinity();  ///< [m] negative inside
  Eigen::Vector3d witness = Eigen::Vector3d::Zero();  ///< nearest surface point, query frame
  /// Unit vector from the surface's outside away from the solid: the way the *point* would go to
  /// get away from (or out of) the solid. Defined at distance 0 too.
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// What is known of where the surface is about a point, where a solid is one mesh.
struct NearSurface {
  double within = std::numeric_limits<double>::infinity();  ///< [m] it is no farther
  enum class Side { kUnknown, kInside, kOutside } side = Side::kUnknown;
};

/// What a search for the deepest point wants to know of a point.
struct PointDepth {
  /// signed_distance(p); `distance` is inf where all that is known is that it is not below what the
  /// search asks for.
  SignedDistance exact;
  /// [m] No point has a signed distance below this minus its way to p. The signed distance itself,
  /// but for meshes with holes: through a hole it jumps from the distance of a point outside to
  /// minus that.
  double floor = std::numeric_limits<double>::infinity();
};

/// The exact geometry of one link: the union of its elements, primitives evaluated in closed form
/// and meshes through a BVH in double precision.
///
/// Outside, the distance is the one to the nearest element. Inside it is minus the depth in the
/// element that holds the point deepest (each element's depth is measured to its own surface). A
/// mesh's inside is where its generalized winding number exceeds 0.5.
/// Immutable; const members are thread safe and allocate nothing.
class Solid {
 public:
  Solid() = default;
  explicit Solid(const LinkGeometry& geometry);

  /// Signed distance of p_L (link frame).
  SignedDistance signed_distance(const Eigen::Vector3d& p_L) const;

  /// As signed_distance, for a point known to be outside (no inside test is made), and only if it
  /// is nearer than `max_distance` [m]; otherwise `distance` is inf.
  /// @param toward_L     unit, about the way from the surface to p_L; a guess for speed, or zero
  /// @param slack        [m] the distance may be this much too large, which is found sooner
  /// @param lower_bound  [m] or null: what it is at least
  SignedDistance distance_outside(const Eigen::Vector3d& p_L, double max_distance,
                                  const Eigen::Vector3d& toward_L = Eigen::Vector3d::Zero(),
                                  double slack = 0.0, double* lower_bound = nullptr) const;

  /// [m] A lower bound that holds nearby too: no point has a signed distance below this minus its
  /// way to p_L. The signed distance itself, but for meshes with holes: through a hole it jumps
  /// from the distance of a point outside to minus that.
  /// @param measured  signed_distance(p_L)
  double distance_floor(const Eigen::Vector3d& p_L, const SignedDistance& measured) const;

  /// signed_distance and distance_floor at once, for points deeper than `enough` [m]: an element
  /// whose surface is found to be no farther is left at that, so that `exact` may stay unknown and
  /// `floor` a little low. Below 0, everything is sought.
  /// @param known  of p_L, for speed
  PointDepth depth(const Eigen::Vector3d& p_L, double enough, const NearSurface& known = {}) const;

  /// [m] How far the solid reaches along a direction: the largest n.x of its points. A point p that
  /// is farther that way is outside, and its distance is at least n.p less this for a unit n.
  /// @param slack    [m] the result may be this much too large, which is found sooner
  /// @param reached  [m] what it is known to reach: the least that is returned
  double support(const Eigen::Vector3d& n_L, double slack = 0.0,
                 double reached = -std::numeric_limits<double>::infinity()) const;

  /// The nearest pair of points of the solid and a solid box, if nearer than `max_distance` [m];
  /// `lower_bound` holds in any case.
  /// 0 where they touch or overlap; only a box within a mesh, which touches no triangle of it, has
  /// its distance to the surface (signed_distance of any of its points tells).
  /// @param box_O  axis-aligned in a frame O, which the result is in
  BoxDistance distance_to_box(const Eigen::AlignedBox3d& box_O, const Eigen::Isometry3d& X_OL,
                              double max_distance) const;

  /// Whether every element is a primitive or a closed mesh. The inside of a mesh with holes ends
  /// in the holes too, not at its surface alone.
  bool is_closed() const;

  /// Whether p_L is inside any element.
  bool is_inside(const Eigen::Vector3d& p_L) const;

  /// Whether it is one mesh and nothing else.
  bool is_one_mesh() const { return elements_.size() == 1 && elements_[0].bvh.size() > 0; }
  bool empty() const { return elements_.empty(); }
  std::size_t triangle_count() const;

 private:
  struct Element {
    Shape primitive;    ///< Box, Cylinder or Sphere; an empty mesh when `bvh` is used
    TriangleBvh sides;  ///< of a Box
    TriangleBvh bvh;
    std::vector<Eigen::Vector3d> normals;  ///< unit, by triangle; zero for triangles without area
    Eigen::Isometry3d X_LE;
    Eigen::Isometry3d X_EL;
    bool is_closed;  ///< no mesh, or one without holes
  };

  std::vector<Element> elements_;
};

}  // namespace ist
