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

/// A message of the node, and where the robot was then.
struct PlacedAnswers {
  ist_proximity::ProximityArray::ConstPtr message;         ///< null: none has come
  Eigen::Isometry3d X_RF = Eigen::Isometry3d::Identity();  ///< the message's frame -> root link
  std::string fault;          ///< a sentence: why that is not known; empty: it is
  std::vector<double> q;      ///< [rad, m] by joint of the kinematics, at the message's stamp
  std::vector<double> moved;  ///< [rad, m] likewise: at most how far each has moved since then
};

/// The distance that a row rests on.
struct RowAnswer {
  std::string link;
  std::string source;          ///< of the nearest obstacle; of a pair, the other link
  double bound;                ///< [m] that the message states
  Eigen::Vector3d p_Rl, p_Ro;  ///< [m] witnesses on link and obstacle, root link; NaN: none
};

/// Makes ConstraintRows of the node's answers, for where the robot is by now. Obstacles are none
/// for links that the node's ~ignore_links leaves out. The blind skin about the robot adds to
/// margin and stop distance of obstacles. Not thread safe.
///
/// The robot's motion since the answers' stamp comes off their bounds: with joints moved by
/// dq, points of a link have moved by at most M = S / (1 - s), S = sum sweep_k |dq_k| and
/// s = sum t_k |dq_k|, because levers grow by at most M; t_k is 1, and more with joints that mimic
/// k. Of a pair both links' motions are in S, in their nearest common body.
class ProximityRows {
 public:
  explicit ProximityRows(std::shared_ptr<const Kinematics> kinematics);

  /// Takes messages of ~proximity and ~self_proximity; the second is null where pairs have no rows.
  void set(const ist_proximity::ProximityArray::ConstPtr& obstacles,
           const ist_proximity::ProximityArray::ConstPtr& self);

  /// @param obstacles, self  of the messages that were set
  /// @param q_now   [rad, m] by joint of the kinematics, now
  /// @param config  its `age` is that of the obstacles now
  /// @param self_stop_distance  [m] of pairs, whose margin is 0
  /// @returns valid until the next call
  const ConstraintRows& rows(const PlacedAnswers& obstacles, const PlacedAnswers& self,
                             const std::vector<double>& q_now, const RowConfig& config,
                             double self_stop_distance);

  /// A link of whose geometry the two messages differ, as after an object was attached; empty:
  /// none.
  const std::string& other_geometry() const { return other_geometry_; }

  /// The origin of a row of the last rows().
  RowAnswer answer(const RowOrigin& origin) const;
  const std::vector<std::size_t>& joints() const { return builder_->joints(); }  ///< by column

 private:
  void build(const std::vector<LinkBox>& boxes, const std::vector<LinkPair>& pairs);
  void read(const PlacedAnswers& obstacles, const PlacedAnswers& self);
  void add_links();
  void move(std::size_t link, Eigen::Vector3d* p_R) const;
  void place(const std::vector<double>& q, BodyPoses* poses);
  double motion(std::size_t row, const std::vector<double>& moved) const;

  std::shared_ptr<const Kinematics> kinematics_;
  ist_proximity::ProximityArray::ConstPtr obstacles_, self_;
  std::optional<ConstraintRowBuilder> builder_;
  std::string other_geometry_;
  std::vector<LinkBox> boxes_;          ///< of the obstacles' links, then of other links of pairs
  std::vector<double> turns_;           ///< by joint of the kinematics: t_k
  std::vector<LinkProximity> results_;  ///< by link of the obstacles' message
  std::vector<bool> ignored_;           ///< likewise
  std::vector<double> obstacle_speeds_;
  std::vector<PairProximity> pair_results_;
  JointPoses joint_poses_;
  BodyPoses then_, now_;
};

}  // namespace ist
