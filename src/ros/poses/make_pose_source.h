#pragma once

#include <memory>

#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_pose_source.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/pose_source.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// Makes the source of link poses that ~pose_source asks for.
/// @param model   ready
/// @param buffer  outlives the result
/// @param joints  outlives the result; null: link poses come from the buffer
/// @param which   the joint states to use
/// @returns null when the URDF's kinematics is needed and faulty
std::unique_ptr<PoseSource> make_pose_source(const ModelState& model, const ServerConfig& config,
                                             const TransformBuffer& buffer,
                                             JointStateListener* joints,
                                             JointPoseSource::Which which);

}  // namespace ist
