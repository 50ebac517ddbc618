#pragma once

#include <urdf_model/joint.h>
#include <urdf_model/link.h>
#include <urdf_model/pose.h>

#include <Eigen/Geometry>

#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// @returns a mesh without triangles for a mesh, whose file is not read here
/// @throws ModelError for a shape that is not supported
Shape to_shape(const urdf::Geometry& geometry);

/// @returns entries that are not finite where the pose's are not
Eigen::Isometry3d to_isometry(const urdf::Pose& pose);

/// Numbers are not checked here: whoever needs the joint's motion checks them.
JointDescription to_joint(const urdf::Joint& joint);

}  // namespace ist
