#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/known_world.h"

namespace ist::benchmark {

/// Bullet beside a known world: its tree of boxes over all elements (btDbvt), and its GJK for
/// convex ones. Meshes are measured as trees of triangles, best first, because Bullet has no
/// distance of two meshes. To 1 mm; each link and object begin with the triangles that were nearest
/// before.
class BulletWorld {
 public:
  virtual ~BulletWorld() = default;
  /// [m] By link: the distance of the nearest object, at most 1 m.
  /// @param X_FB  by frame of the objects
  virtual const std::vector<double>& run(const std::vector<Eigen::Isometry3d>& X_FL,
                                         const std::vector<Eigen::Isometry3d>& X_FB) = 0;
};

/// @param frames  by object: the number of its frame
std::unique_ptr<BulletWorld> bullet_world(const std::vector<LinkGeometry>& links,
                                          const std::vector<WorldObject>& objects,
                                          const std::vector<std::size_t>& frames);

}  // namespace ist::benchmark
