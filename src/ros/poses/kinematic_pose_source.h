#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/poses/pose_source.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// The common part of sources that turn the poses of joints into those of links.
class KinematicPoseSource : public PoseSource {
 public:
  void look_up_all(const Kinematics& /*kinematics*/, const ros::Time& /*instant*/,
                   BodyPoses* bodies) override {
    *bodies = bodies_;
  }

 protected:
  /// @param buffer       outlives this
  /// @param fixed_frame  frame F
  /// @param links        names, in the order of StampedLinkPoses
  /// @param wanted       by link: false leaves it unknown, without a problem
  /// @param timeout      [s] allowed age of transforms and joint states
  KinematicPoseSource(std::shared_ptr<const Kinematics> kinematics, const TransformBuffer& buffer,
                      std::string fixed_frame, const std::vector<std::string>& links,
                      std::vector<bool> wanted, double timeout);

  /// Makes every link and body unknown, as StampedLinkPoses::reset() does.
  void reset(const ros::Time& now, StampedLinkPoses* poses);
  /// Places bodies and links by `joints_` and `X_FR_`.
  /// @param joint_problems  by joint: why its pose is not known
  /// @param poses           receives the links; its stamp stays
  void place(const std::vector<PoseProblem>& joint_problems, StampedLinkPoses* poses);

  const std::shared_ptr<const Kinematics> kinematics_;
  const TransformBuffer& buffer_;
  const std::string fixed_frame_;
  const double timeout_;
  std::vector<bool> wanted_;
  JointPoses joints_;
  Eigen::Isometry3d X_FR_ = Eigen::Isometry3d::Identity();  ///< root link -> fixed frame

 private:
  std::vector<std::size_t> index_;  ///< by link: its body; else the number of bodies
  BodyPoses bodies_;
};

}  // namespace ist
