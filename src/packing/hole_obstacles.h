#pragma once

#include <Eigen/Core>
#include <optional>

#include "internal/geometry/mesh_surface.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/geometry/shapes.h"
#include "packing_watch.h"
#include "sphere_search.h"

namespace ist {

/// Obstacles that keep inner spheres away from the holes of a mesh.
///
/// A point is outside where the generalized winding number is at most 0.5. In a hole the inside
/// therefore ends without a triangle, at its opening: the part of the isosurface 0.5 that is off
/// the mesh. Let D(p) be the distance from p to the mesh. A sphere (c, r) comes too near to a point
/// p outside if |p - c| - r < D(p). On the way from p to c the
/// first side falls by the length of the way and the second by no more, so it is enough that no
/// point x of an opening has |x - c| - r < D(x), and that no triangle enters the sphere. Hence the
/// spheres (x, D(x)) about all points of the openings are obstacles to inner spheres. A few larger
/// spheres stand for them here.
///
/// Openings are searched at first where triangles (caps) would close the holes. Open meshes that
/// are not surfaces with holes (flaps, parts that overlap) have openings elsewhere, too: admits()
/// searches for them about each sphere, and what it finds becomes an obstacle. Boundary edges are
/// obstacles of a small radius, for cracks.
///
/// Watertight meshes have no openings and cost nothing.
class HoleObstacles {
 public:
  /// @param surface    of the mesh; its hierarchy must outlive this
  /// @param tolerance  [m] how much larger than necessary an obstacle may be; > 0
  /// @param watch      must outlive this; when it stops, the search ends and obstacles are missing
  HoleObstacles(const TriangleMesh& mesh, const MeshSurface& surface, double tolerance,
                PackingWatch* watch);

  struct Obstacle {
    Eigen::Vector3d center;
    double radius;    ///< [m]
    double distance;  ///< [m] from the point to the obstacle; negative within it
  };
  /// The obstacle nearest to x; `distance` is `max_distance` where none is nearer.
  Obstacle nearest(const Eigen::Vector3d& x, double max_distance) const;

  /// Whether a sphere that touches no triangle and no obstacle may be taken: its centre is inside,
  /// and no opening is too near. An opening that is too near becomes an obstacle.
  bool admits(const Eigen::Vector3d& center, double radius);

  bool is_closed() const { return edges_.size() == 0; }
  std::size_t sphere_count() const { return spheres_.size(); }
  /// False when the packing has to stop; what is found from then on is not used.
  bool keeps_on() const { return watch_.keeps_on(); }

 private:
  struct Cap {  ///< a triangle that closes a hole, or a part of one
    Eigen::Vector3d a, b, c;
    Eigen::Vector3d centroid() const { return (a + b + c) / 3.0; }
  };
  using OpeningPoint = std::optional<Eigen::Vector3d>;

  void search_caps(const TriangleMesh& caps);
  void search_cap(const Cap& cap);
  void search_halves(const Cap& cap);
  bool is_covered(const Cap& cap, const Eigen::Vector3d& q) const;
  Eigen::Vector3d climb_in_plane(const Eigen::Vector3d& y, const Eigen::Vector3d& normal,
                                 const ClosestPoint& closest) const;
  OpeningPoint opening_across(const Eigen::Vector3d& y, const Eigen::Vector3d& normal,
                              double distance) const;
  OpeningPoint opening_along(const Eigen::Vector3d& center, double radius,
                             const Eigen::Vector3d& ray, double* margin) const;
  OpeningPoint opening_near(const Eigen::Vector3d& center, double radius, Eigen::Vector3d ray,
                            double margin) const;
  bool may_be_near(const Eigen::Vector3d& center, double radius) const;
  bool is_outside(const Eigen::Vector3d& p) const;
  double distance_to_mesh(const Eigen::Vector3d& p) const;
  void add_obstacle(const Eigen::Vector3d& opening);

  const TriangleBvh& bvh_;
  PackingWatch& watch_;
  double tolerance_;
  TriangleBvh edges_;  ///< boundary edges as triangles without area: obstacles of radius tolerance_
  SphereSearch spheres_;       ///< obstacles
  SphereSearch uncertain_;     ///< where openings may be that spheres_ do not cover
  std::size_t cap_count_ = 0;  ///< caps and parts of caps searched
};

}  // namespace ist
