#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/ProximityArray.h"
#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// Makes ConstraintRows of the node's answers, for where the robot is by now. Not thread safe.
///
/// The robot's motion since the answers' stamp comes off their bounds: with joints moved by
/// dq, points of a link have moved by at most M = S / (1 - s), S = sum sweep_k |dq_k| and
/// s = sum t_k |dq_k|, because levers grow by at most M; t_k is 1, and more with joints that mimic
/// k.
class ProximityRows {
 public:
  explicit ProximityRows(std::shared_ptr<const Kinematics> kinematics);

  /// Takes the answers of one instant.
  /// @param X_RF  frame of the answers -> root link
  void set(const ist_proximity::ProximityArray::ConstPtr& answers, const Eigen::Isometry3d& X_RF);
  void clear() { answers_.reset(); }

  /// @param q_then  [rad, m] by joint of the kinematics, at the answers' stamp
  /// @param q_now   [rad, m] the same, now
  /// @param config  its `age` is that of the obstacles now
  /// @returns valid until the next call
  const ConstraintRows& rows(const std::vector<double>& q_then, const std::vector<double>& q_now,
                             RowConfig config);

  /// The link of a row, its source, and the bound [m] that the answer states.
  const ist_proximity::LinkProximity& answer(const RowOrigin& origin) const {
    return answers_->links[static_cast<std::size_t>(origin.index)];
  }
  const std::vector<std::size_t>& joints() const { return builder_->joints(); }  ///< by column
  bool has_answers() const { return answers_ != nullptr; }
  const ist_proximity::ProximityArray& answers() const { return *answers_; }

 private:
  void build(const std::vector<LinkBox>& boxes);
  void read(const ist_proximity::LinkProximity& message, LinkProximity* result) const;
  void place(const std::vector<double>& q, BodyPoses* poses);
  double motion(std::size_t row, const std::vector<double>& q_then,
                const std::vector<double>& q_now) const;

  std::shared_ptr<const Kinematics> kinematics_;
  ist_proximity::ProximityArray::ConstPtr answers_;
  Eigen::Isometry3d X_RF_ = Eigen::Isometry3d::Identity();
  std::optional<ConstraintRowBuilder> builder_;
  std::vector<LinkBox> boxes_;
  std::vector<double> turns_;  ///< by joint of the kinematics: t_k
  std::vector<LinkProximity> results_;
  std::vector<double> obstacle_speeds_;
  JointPoses joint_poses_;
  BodyPoses then_, now_;
};

}  // namespace ist
