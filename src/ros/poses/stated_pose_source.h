#pragma once

#include <sensor_msgs/JointState.h>
#include <tf2/buffer_core.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Link poses of a configuration that somebody states, and the robot need not be in. Joints that
/// are left out, planar and floating ones, and where the root is in the fixed frame, are as tf has
/// them now.
class StatedPoseSource : public PoseSource {
 public:
  /// @param buffer       outlives this
  /// @param fixed_frame  frame F
  /// @param links        names
  /// @param timeout      [s] of what tf tells
  StatedPoseSource(std::shared_ptr<const Kinematics> kinematics, const tf2::BufferCore& buffer,
                   const std::string& fixed_frame, const std::vector<std::string>& links,
                   double timeout);

  /// @param wanted  by link: false leaves it unknown and out of everything
  void set_wanted(const std::vector<bool>& wanted) { wanted_ = wanted; }

  /// The configuration that look_up() places the robot in; its stamp is not read.
  /// @returns empty on success, else a sentence; then the configuration before goes on
  std::string state(const sensor_msgs::JointState& configuration);

  /// Of the configuration stated: by joint, NaN where it is left out.
  const std::vector<double>& positions() const { return q_; }
  /// Of the last look_up(): all joints, and the root link -> fixed frame.
  const JointPoses& joints() const { return joints_; }
  const Eigen::Isometry3d& root() const { return X_FR_; }

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override;
  void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                   BodyPoses* bodies) override;
  std::string hint() const override;

 private:
  std::shared_ptr<const Kinematics> kinematics_;
  const tf2::BufferCore& buffer_;
  std::string fixed_frame_;
  std::vector<std::size_t> places_;  ///< by link: its body; none: the number of bodies
  std::vector<bool> wanted_;
  double timeout_;
  std::vector<double> q_;  ///< by joint; NaN: left out
  JointPoses joints_;
  Eigen::Isometry3d X_FR_ = Eigen::Isometry3d::Identity();
  BodyPoses bodies_;  ///< of the last look_up()
};

}  // namespace ist
