#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/robot/kinematics.h"
#include "ros/parameters/source_config.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/transform_buffer.h"
#include "ros/poses/transforms.h"

namespace ist {

/// Another robot as an obstacle: its links are objects, whose frames move with it. Their poses come
/// from tf, or from its joint states by the node's own kinematics.
class OtherRobot {
 public:
  /// @param base_frame  frame of its root link in tf; empty: the prefix and the root link's name
  OtherRobot(const OtherRobotConfig& config, const std::string& base_frame,
             const ros::NodeHandle& nh);

  /// Reads its description from the parameter server.
  /// @param cancelled  asked now and then; true ends the reading
  /// @param faults     one sentence for each link whose geometry cannot be read
  /// @returns empty, or why it cannot be read yet
  std::string read(const std::function<bool()>& cancelled, std::vector<WorldObject>* links,
                   std::vector<WorldFault>* faults);

  /// Whether a frame is known from its joint states alone, and so has no name in tf.
  bool owns(const std::string& frame) const;

  /// Looks up where a frame that it owns is.
  /// @param buffer  with the poses of frames other than its own
  /// @param lag     see ist::look_up_near()
  /// @returns empty on success, else a sentence. Thread safe
  std::string look_up_frame(const TransformBuffer& buffer, const std::string& fixed_frame,
                            const std::string& frame, const ros::Time& time, double max_age,
                            Eigen::Isometry3d* X_FB, Lag* lag) const;

 private:
  const OtherRobotConfig config_;
  const std::string base_frame_;
  ros::NodeHandle nh_;
  std::shared_ptr<TransformBuffer> own_buffer_;  ///< its links' poses in its root; null: from tf
  std::unique_ptr<JointStateListener> joint_states_;

  mutable std::mutex mutex_;  // guards the next one
  std::string root_link_;
};

}  // namespace ist
