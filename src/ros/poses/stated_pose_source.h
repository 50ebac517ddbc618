#pragma once

#include <sensor_msgs/JointState.h>

#include <memory>
#include <string>
#include <vector>

#include "ros/poses/kinematic_pose_source.h"

namespace ist {

/// Link poses of a configuration that a request states; the robot need not be in it. Joints that
/// the request leaves out, planar and floating joints, and the pose of the root link in the fixed
/// frame come from tf as they are now, see Stamp. A mimic joint of a stated joint follows it,
/// unless it is elsewhere now than its formula says: then it is not known.
class StatedPoseSource : public KinematicPoseSource {
 public:
  /// The stamp of the poses, at which obstacles in frames that move are looked up.
  enum class Stamp {
    kOfRobot,  ///< the instant at which tf knows all that is not stated
    kNow,      ///< the present: each thing that is not stated is where tf knew it last
  };

  /// @param mimic_tolerance  [rad, m] by which a mimic joint may be elsewhere now than led
  StatedPoseSource(std::shared_ptr<const Kinematics> kinematics, const TransformBuffer& buffer,
                   const std::string& fixed_frame, const std::vector<std::string>& links,
                   double timeout, double mimic_tolerance, Stamp stamp);

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
  /// Whether a motion from there is known: they hold, and mimic joints follow.
  bool is_motion_known() const { return root_known_ && mimics_follow_; }

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override;
  bool is_stated() const override { return true; }
  std::string newest_root(Eigen::Isometry3d* X_FR) const override;
  void look_up_joints_again(const ros::Time& now, StampedLinkPoses* poses) override;
  std::string hint() const override;

 private:
  std::string look_up_latest(const std::string& to, const std::string& from, const ros::Time& now,
                             Eigen::Isometry3d* X);
  void look_up_joints(const ros::Time& now, StampedLinkPoses* poses);
  std::string why_strays(std::size_t joint, const ros::Time& now) const;
  void check_mimics(const ros::Time& now, std::vector<PoseProblem>* problems);

  const double mimic_tolerance_;
  const Stamp stamp_;
  std::vector<double> q_;  ///< by joint; NaN where it is left out
  ros::Time instant_;      ///< the newest at which tf knows all that is left out
  bool root_known_ = false;
  bool mimics_follow_ = true;
};

}  // namespace ist
