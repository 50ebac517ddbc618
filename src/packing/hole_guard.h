#pragma once

#include <Eigen/Core>
#include <optional>

#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/geometry/shapes.h"
#include "sphere_search.h"

namespace ist {

/// Keeps inner spheres away from the holes of a mesh.
///
/// Outside is where the winding number is at most 0.5, so in a hole the inside ends without a
/// triangle, at the exits: the points off the mesh where it is 0.5. With D(p) the distance to the
/// mesh, a sphere (c, r) is too near to a point p outside if |p - c| - r < D(p). On the way from p
/// to c the left side falls by the way moved, the right side by no more: it is enough that no exit
/// x has |x - c| - r < D(x), and that no triangle is in the sphere. So the spheres about all exits
/// x that reach to the mesh, of radius D(x), are obstacles to inner spheres; a few larger ones
/// stand for them here.
///
/// Exits are looked for at first where triangles would close the holes. In open meshes that are not
/// surfaces with holes (flaps, parts that overlap) they are elsewhere too: `admits` looks for them
/// about each sphere that is to be taken, and what it finds is an obstacle from then on. Open edges
/// are obstacles of a small radius, for cracks.
///
/// Watertight meshes have no exits and cost nothing.
class HoleGuard {
 public:
  /// @param bvh        of the mesh; must outlive this
  /// @param tolerance  [m] how much larger than needed an obstacle may be; > 0
  HoleGuard(const TriangleMesh& mesh, const TriangleBvh& bvh, double tolerance);

  struct Obstacle {
    Eigen::Vector3d center;
    double radius;    ///< [m]
    double distance;  ///< [m] from the point to the obstacle; negative within
  };
  /// The obstacle nearest to x; `distance` is `at_most` where none is nearer.
  Obstacle nearest(const Eigen::Vector3d& x, double at_most) const;

  /// Whether the sphere, which touches no triangle and no obstacle, may be taken: its centre is
  /// inside and no exit was found too near. If one was, it is an obstacle now.
  bool admits(const Eigen::Vector3d& center, double radius);

  bool is_closed() const { return edges_.size() == 0; }
  std::size_t sphere_count() const { return spheres_.size(); }

 private:
  struct Corners {
    Eigen::Vector3d a, b, c;
  };
  void close(const TriangleMesh& caps);
  void look_about(const Corners& cap);
  bool is_held(const Corners& cap, const Eigen::Vector3d& q) const;
  Eigen::Vector3d climbed(const Eigen::Vector3d& y, const Eigen::Vector3d& normal,
                          const ClosestPoint& closest) const;
  std::optional<Eigen::Vector3d> exit_across(const Eigen::Vector3d& y,
                                             const Eigen::Vector3d& normal, double reach) const;
  std::optional<Eigen::Vector3d> exit_along(const Eigen::Vector3d& center, double radius,
                                            const Eigen::Vector3d& ray, double* margin) const;
  std::optional<Eigen::Vector3d> exit_about(const Eigen::Vector3d& center, double radius,
                                            Eigen::Vector3d ray, double least) const;
  bool may_be_near(const Eigen::Vector3d& center, double radius) const;
  bool is_open(const Eigen::Vector3d& p) const;
  double to_mesh(const Eigen::Vector3d& p) const;
  void add(const Eigen::Vector3d& exit);

  const TriangleBvh& bvh_;
  double tolerance_;
  TriangleBvh edges_;  // open edges, as triangles without area: obstacles of radius tolerance_
  SphereSearch spheres_;
  SphereSearch doubtful_;  // where caps are, and exits that spheres_ do not hold may be; with D
  std::size_t caps_seen_ = 0;
};

}  // namespace ist
