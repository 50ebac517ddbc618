#pragma once

#include <geometry_msgs/Pose.h>
#include <ist_proximity/WorldObject.h>

#include <Eigen/Geometry>
#include <string>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/robot/robot_description.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// Converts a message of ADD, reading the mesh file that it may name.
/// @param config  its frame_id and margin are those of objects that state none
/// @throws ModelError, Cancelled
WorldObject to_world_object(const ist_proximity::WorldObject& message, const WorldConfig& config,
                            const CancelRequest& cancelled);

/// Converts the shape of a message of ADD, in the object's frame.
/// @throws ModelError naming the field that is wrong, its value and what is allowed; Cancelled
GeometryElement to_element(const ist_proximity::WorldObject& message,
                           const PackageFinder& find_package, const CancelRequest& cancelled);

/// The frame of an object.
/// @param stated  by a message; empty: `other` is
/// @throws ModelError where it is the name of no frame
std::string object_frame(const std::string& stated, const std::string& other);

/// Converts a pose.
/// @throws ModelError
Eigen::Isometry3d to_object_pose(const geometry_msgs::Pose& pose);

}  // namespace ist
