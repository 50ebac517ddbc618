#pragma once

#include <ist_proximity/TrajectoryClearance.h>
#include <visualization_msgs/MarkerArray.h>

#include "ist_proximity/robot/kinematics.h"
#include "ros/model/model_state.h"

namespace ist {

/// Draws a robot where it touches for rviz, and the time until then as one number. Namespaces:
/// "ghost" (the largest inner spheres of the monitored links) and "time", at the link that touches
/// first. rviz drops them when they
/// are not renewed for half a second.
/// @param message  CONTACT
/// @param model    has a robot and its kinematics
/// @param bodies   the robot at the contact, in the frame of the message
visualization_msgs::MarkerArray trajectory_markers(
    const ist_proximity::TrajectoryClearance& message, const ModelState& model,
    const BodyPoses& bodies);

}  // namespace ist
