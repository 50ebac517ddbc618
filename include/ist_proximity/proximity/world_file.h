#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/proximity/known_world.h"

namespace ist {

/// A cone about the z axis of its frame, centred between base (at -z) and tip. Its mesh encloses
/// the cone: it has 128 sides that touch the base's circle, and is nowhere farther from the cone
/// than 3e-4 radii.
/// @param radius, length  [m] > 0
TriangleMesh cone(double radius, double length);

/// A box of 100 m x 100 m and 10 m thickness for the half-space below a plane n.x = offset. Queries
/// have no shape without end.
/// @param n       unit, out of the ground
/// @param offset  [m]
GeometryElement half_space(const Eigen::Vector3d& n, double offset);

/// The objects of a scene.
struct SceneFile {
  std::vector<WorldObject> objects;  ///< in the order of the file
  std::string fault;                 ///< why the text cannot be used; empty: it can
};

/// Reads the text of a MoveIt scene (`.scene`), as rviz exports it: with the poses of objects or,
/// before MoveIt 1.1, without. Shapes are box, sphere, cylinder, cone, plane and mesh. Colours and
/// subframes are read over.
/// @param frame  that objects stand in; the format names none
/// @param limits more objects or triangles are a fault, found before memory is taken for them
SceneFile parse_scene(const std::string& text, const std::string& frame,
                      const WorldLimits& limits = {});

/// Reads such a file of up to 256 MB.
SceneFile read_scene_file(const std::string& path, const std::string& frame,
                          const WorldLimits& limits = {});

}  // namespace ist
