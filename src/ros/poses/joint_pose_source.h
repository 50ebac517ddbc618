#pragma once

#include <tf2/buffer_core.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/link_placer.h"
#include "ros/poses/tf_pose_source.h"

namespace ist {

/// Computes link poses from joint states.
///
/// The poses belong to the stamp of the newest joint state, or of the one that was taken last. A
/// joint with a slower publisher keeps its last position until that is older than the timeout; then
/// the links below it are unknown. The poses of planar and floating joints, and of the root link in
/// the fixed frame, come from tf at the same instant. While tf is behind the joint states, all
/// poses are those of the newest instant at which both tf and the joints are known.
class JointPoseSource : public PoseSource {
 public:
  /// kTaken: the message that JointStateListener::take_next() has taken.
  enum class Which { kNewest, kTaken };

  /// @param joints       feeds `buffer`; both outlive this
  /// @param which        the joint states that look_up() uses
  /// @param fixed_frame  frame F
  /// @param links        names
  /// @param wanted       by link: false leaves it unknown, without a problem
  /// @param timeout      [s]
  JointPoseSource(std::shared_ptr<const Kinematics> kinematics, JointStateListener* joints,
                  Which which, const tf2::BufferCore& buffer, const std::string& fixed_frame,
                  const std::vector<std::string>& links, const std::vector<bool>& wanted,
                  double timeout);

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override;
  void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                   BodyPoses* bodies) override;
  std::string hint() const override;

 private:
  ros::Time read_positions(const ros::Time& now);
  bool look_up_in_tf(const std::string& parent, const std::string& child, const ros::Time& now,
                     const ros::Time& instant, Eigen::Isometry3d* X, std::string* problem);

  std::shared_ptr<const Kinematics> kinematics_;
  JointStateListener& listener_;
  const Which which_;
  const tf2::BufferCore& buffer_;
  std::string fixed_frame_;
  LinkPlacer placer_;
  std::vector<bool> wanted_;
  double timeout_;
  TfPoseSource tf_source_;  ///< used while tf is behind

  // Valid for one look_up().
  JointPositions positions_;
  std::vector<double> q_;                    ///< by joint; NaN where it is not known
  std::vector<std::string> joint_problems_;  ///< by joint
  JointPoses joints_;
  bool tf_is_behind_ = false;
};

}  // namespace ist
