#pragma once

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/poses/kinematic_pose_source.h"
#include "ros/poses/tf_pose_source.h"

namespace ist {

/// Computes link poses from joint states.
///
/// The poses belong to the stamp of the newest joint state, or of the one that was taken last. A
/// joint with a slower publisher keeps its last position as long as that is no older than its
/// samples usually are (see is_late()). The links below a joint are unknown when it is later than
/// that, older than the timeout, or disputed by two publishers, and when its newest sample was
/// refused while other joints of the same message went on. When only that sample was refused, the
/// last poses stay, with their stamp, until the joint is late.
///
/// The poses of planar and floating joints, and of the root link in the fixed frame, come from tf
/// at the same instant. While tf is behind the joint states, all poses are those of the newest
/// instant at which both tf and the joints are known. The instant never goes back.
class JointPoseSource : public KinematicPoseSource {
 public:
  /// @param joints  feeds `buffer`; outlives this
  /// @param which   the joint states that look_up() uses
  JointPoseSource(std::shared_ptr<const Kinematics> kinematics, JointStateListener* joints,
                  JointStateListener::Which which, const TransformBuffer& buffer,
                  const std::string& fixed_frame, const std::vector<std::string>& links,
                  const std::vector<bool>& wanted, double timeout);

  void look_up(const ros::Time& now, StampedLinkPoses* poses) override;
  void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                   BodyPoses* bodies) override;
  Span<const double> joint_velocities() const override { return velocities_; }
  Span<const StoppingReach> joint_lags() const override { return lags_; }
  std::string hint() const override;

 private:
  ros::Time read_positions(const ros::Time& now);
  bool has_own(std::size_t joint) const;
  PoseProblem problem_of(std::size_t joint, const ros::Time& now) const;
  std::string is_late(std::size_t joint, std::size_t newest) const;
  bool must_hold(const ros::Time& instant) const;
  void find_lags(const ros::Time& instant);
  void describe_doubts(StampedLinkPoses* poses) const;
  void look_up_behind(const ros::Time& now, StampedLinkPoses* poses);
  bool look_up_in_tf(const std::string& parent, const std::string& child, const ros::Time& now,
                     const ros::Time& instant, Eigen::Isometry3d* X, PoseProblem* problem);

  JointStateListener& listener_;
  const JointStateListener::Which which_;
  std::vector<std::vector<std::size_t>> moved_by_;  ///< by link: the joints whose positions move it
  std::vector<bool> matters_;                       ///< by joint: whether it moves a wanted link
  TfPoseSource tf_source_;                          ///< used while tf is behind

  // Valid for one look_up().
  JointPositions positions_;
  std::vector<double> q_;                    ///< by joint; NaN where it is not known
  std::vector<double> velocities_;           ///< likewise, or empty
  std::vector<PoseProblem> joint_problems_;  ///< by joint
  std::vector<StoppingReach> lags_;          ///< by joint, or empty; kept while poses are held
  bool tf_is_behind_ = false;
  StampedLinkPoses last_;  ///< the result of the last look_up()
};

/// Makes the source of link poses that ~pose_source asks for.
/// @param model   ready
/// @param buffer  outlives the result
/// @param joints  outlives the result; null: link poses come from the buffer
/// @param which   the joint states to use
/// @returns null when the URDF's kinematics is needed and faulty
std::unique_ptr<PoseSource> make_pose_source(const ModelState& model, const ServerConfig& config,
                                             const TransformBuffer& buffer,
                                             JointStateListener* joints,
                                             JointStateListener::Which which);

}  // namespace ist
