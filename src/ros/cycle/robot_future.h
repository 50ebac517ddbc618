#pragma once

#include <ros/time.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/proximity/stopping_reach.h"
#include "ist_proximity/robot/kinematics.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Bounds what links can still sweep until the robot stands, where ~joint_deceleration is stated.
class RobotFuture {
 public:
  /// @param kinematics  null where it is faulty: nothing is known then
  /// @param boxes       by link of the robot
  /// @param monitored   links of the robot, of which the results are
  RobotFuture(const JointDeceleration& deceleration, std::shared_ptr<const Kinematics> kinematics,
              const std::vector<LinkBox>& boxes, const std::vector<std::size_t>& monitored);

  /// Whether ~joint_deceleration is stated; nothing below is of use otherwise.
  bool is_stated() const { return is_stated_; }
  /// A sentence on joints that are stated and that the URDF lacks; else empty. Nothing is known
  /// then, since the joint that is meant has not its deceleration.
  const std::string& problem() const { return problem_; }

  /// @param source   after its look_up(); may be null
  /// @param instant  of the poses
  void update(PoseSource* source, const ros::Time& instant);

  /// [m] What is left of a distance of a monitored link that is proven at the instant of update().
  double left_of(std::size_t link, double lower_bound) const;
  /// By monitored link: what it would reach from where it is, if all joints moved as fast as the
  /// URDF allows.
  Span<const StoppingReach> at_full_speed() const { return at_full_speed_; }

 private:
  const bool is_stated_;
  const std::shared_ptr<const Kinematics> kinematics_;
  std::string problem_;
  std::vector<Eigen::AlignedBox3d> boxes_;  ///< [m] by monitored link, in its frame
  std::vector<std::size_t> links_;          ///< their bodies; 0: no joint moves it
  std::vector<double> decelerations_;       ///< by joint
  std::vector<StoppingReach> fastest_;      ///< by joint
  // Valid until the next update().
  std::vector<StoppingReach> joints_;
  std::vector<StoppingReach> now_, at_full_speed_;  ///< by monitored link
  BodyPoses bodies_;
};

}  // namespace ist
