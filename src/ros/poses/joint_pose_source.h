#pragma once

#include <tf2/buffer_core.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/tf_pose_source.h"

namespace ist {

/// Computes link poses from joint states.
///
/// They belong to the stamp of the newest joint state, or of the one whose turn it is. A joint that
/// came earlier, from a slower publisher, keeps its last position until that is older than the
/// timeout; then the links below it are not known. What joint states cannot tell comes from tf at
/// the same instant: planar and floating joints, and where the root link is in the fixed frame.
/// While tf is behind the joint states, all poses are those of the newest instant at which tf and
/// joints are known.
class JointPoseSource : public PoseSource {
 public:
  /// kTaken: of the message that JointStateListener::take_next() has come to.
  enum class Which { kNewest, kTaken };

  /// @param joints       feeds `buffer`; both outlive this
  /// @param which        joint states it looks at
  /// @param fixed_frame  frame F
  /// @param links        names
  /// @param wanted       by link: false leaves it unknown and out of everything
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
  bool ask_tf(const std::string& parent, const std::string& child, const ros::Time& now,
              const ros::Time& instant, Eigen::Isometry3d* X, std::string* problem);

  std::shared_ptr<const Kinematics> kinematics_;
  JointStateListener& listener_;
  const Which which_;
  const tf2::BufferCore& buffer_;
  std::string fixed_frame_;
  std::vector<std::size_t> places_;  ///< by link: its body; none: the number of bodies
  std::vector<bool> wanted_;
  double timeout_;
  TfPoseSource behind_;  ///< for when tf is behind

  // Of this call.
  std::vector<JointStateListener::Position> newest_;
  std::vector<double> q_;                    ///< by joint; NaN: not known
  std::vector<std::string> joint_problems_;  ///< by joint
  JointPoses joints_;
  bool tf_is_behind_ = false;
  BodyPoses bodies_;
};

}  // namespace ist
