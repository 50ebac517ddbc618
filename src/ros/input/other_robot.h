#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/robot/kinematics.h"
#include "ros/parameters/source_config.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// Another robot as an obstacle: its links are objects, whose frames move with it. Their poses come
/// from tf, or from its joint states by the node's own kinematics, which puts them into the buffer
/// under names that no frame of tf has.
class OtherRobot {
 public:
  /// @param base_frame  frame of its root link in tf; empty: the prefix and the root link's name
  /// @param source      name of the source that it belongs to
  /// @param buffer      outlives this
  OtherRobot(const OtherRobotConfig& config, const std::string& base_frame,
             const std::string& source, const ros::NodeHandle& nh, TransformBuffer* buffer);

  /// Reads its description from the parameter server.
  /// @param cancelled  asked now and then; true ends the reading
  /// @param faults     one sentence for each link whose geometry cannot be read
  /// @returns empty, or why it cannot be read yet
  std::string read(const std::function<bool()>& cancelled, std::vector<WorldObject>* links,
                   std::vector<WorldFault>* faults);

  /// Whether a frame is known from its joint states alone, and so has no name in tf.
  bool owns(const std::string& frame) const;

 private:
  const OtherRobotConfig config_;
  const std::string base_frame_;
  const std::string prefix_;  ///< of its links' frames in the buffer
  ros::NodeHandle nh_;
  TransformBuffer& buffer_;
  std::unique_ptr<JointStateListener> joint_states_;  ///< null: its poses come from tf
};

}  // namespace ist
