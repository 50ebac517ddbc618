#pragma once

#include <sensor_msgs/JointState.h>

#include <memory>
#include <string>
#include <vector>

#include "ros/poses/kinematic_pose_source.h"

namespace ist {

/// Link poses of a configuration that a request states; the robot need not be in it. Joints that
/// the request leaves out, planar and floating joints, and the pose of the root link in the fixed
/// frame come from tf as they are now: at the newest instant at which it knows them all, which is
/// that of the poses.
class StatedPoseSource : public KinematicPoseSource {
 public:
  StatedPoseSource(std::shared_ptr<const Kinematics> kinematics, const TransformBuffer& buffer,
                   const std::string& fixed_frame, const std::vector<std::string>& links,
                   double timeout);

  /// @param wanted  by link: false leaves it unknown, without a problem
  void set_wanted(const std::vector<bool>& wanted) { wanted_ = wanted; }

  /// Sets the configuration that look_up() places the robot in; its stamp is not read.
  /// @returns empty on success, else a sentence; then the configuration before stays
  std::string state(const sensor_msgs::JointState& configuration);

  /// The stated positions by joint; NaN for joints that are left out.
  const std::vector<double>& positions() const { return q_; }
  // Results of the last look_up().
  const JointPoses& joints() const { return joints_; }
  const Eigen::Isometry3d& X_FR() const { return X_FR_; }  ///< root link -> fixed frame
  bool is_root_known() const { return root_known_; }       ///< whether joints() and X_FR() hold

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override;
  bool is_stated() const override { return true; }
  std::string hint() const override;

 private:
  std::vector<double> q_;  ///< by joint; NaN where it is left out
  bool root_known_ = false;
};

}  // namespace ist
