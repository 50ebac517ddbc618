#pragma once

#include <visualization_msgs/MarkerArray.h>

#include <Eigen/Geometry>
#include <functional>
#include <string>

#include "ist_proximity/proximity/known_world.h"

namespace ist {

/// Sets what a marker of a shape needs: type, pose, size, and the triangles of a mesh.
/// @param X  the shape's frame -> the marker's
void draw_shape(const Shape& shape, const Eigen::Isometry3d& X, visualization_msgs::Marker* marker);

/// Draws the objects of a world, each in its frame, after what was drawn before is deleted. A mesh
/// of more than 20000 triangles is drawn as the box about it.
/// @param frame_of  the tf name of a frame of the world; empty: its objects are not drawn
visualization_msgs::MarkerArray world_markers(
    const KnownWorld& world, const std::function<std::string(const std::string&)>& frame_of);

}  // namespace ist
