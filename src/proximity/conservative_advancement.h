#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>

#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/link_poses.h"
#include "proximity/motion_bound.h"

namespace ist {

/// [rad, m] Sums of larger positions are rounded by more than what counts as contact.
constexpr double kLargestMotion = 1e9;

/// The links of a robot along a motion of its joints.
class MovedRobot {
 public:
  MovedRobot(const RobotModel& model, std::shared_ptr<const Kinematics> kinematics)
      : forward_(model, std::move(kinematics)) {}

  /// Begins a motion.
  /// @param still  poses of joints that it does not move; outlives the motion
  /// @returns false where the sizes are not those of the kinematics' joints, the duration is not
  ///          finite and more than 0, or a joint has one position or a too large one
  bool begin(const JointMotion& motion, const JointPoses& still);
  /// Places the links where they are after `time` [s]. @param X_FR  root link -> fixed frame
  void place(double time, const Eigen::Isometry3d& X_FR = Eigen::Isometry3d::Identity());

  /// Bounds the motion of a sphere [m] that is fixed to a body, in that body's frame.
  /// @param ancestor  the motion is that in its frame
  MotionBound bound(std::size_t body, const Eigen::Vector3d& center, double radius,
                    std::size_t ancestor = 0) const {
    return {kinematics(), motion_, body, center, radius, ancestor};
  }
  /// Bounds how far such a sphere is from where the motion has it, while no joint is farther from
  /// it than `deviation` [rad, m]: as the speed of a motion by that much in a second.
  MotionBound bound_deviation(std::size_t body, const Eigen::Vector3d& center, double radius,
                              const std::vector<double>& deviation) const;
  double duration() const { return motion_.duration; }  ///< [s]
  const Kinematics& kinematics() const { return forward_.kinematics(); }
  const ForwardKinematics& forward() const { return forward_; }

 private:
  ForwardKinematics forward_;
  JointMotion motion_;  // with the positions of mimic joints
  const JointPoses* still_ = nullptr;
  JointPoses moved_;
};

/// The time of impact by conservative advancement (Mirtich 1996): what is proven to be d apart does
/// not touch before it has come nearer by d.
/// @param duration  [s] of the motion
/// @param measure   measure(time, tolerance) places everything where it is after a time [s], and
///                  returns a proven lower bound of the distance [m] there; NaN: not known
/// @param time_for  time_for(distance): nothing comes nearer by so much [m] within that time [s]
template <class Measure, class TimeFor>
ImpactTime advance(double duration, const Measure& measure, const TimeFor& time_for) {
  constexpr double kTouch = 1e-6;  // [m] a bound below it is contact
  constexpr int kMaxSteps = 4000;
  // Tolerance of the next distance: as a ratio to the last bound, and in [m] at the first step.
  constexpr double kRelativeTolerance = 0.1, kFirstTolerance = 0.01;
  ImpactTime impact;
  double time = 0.0, tolerance = kFirstTolerance;
  for (; impact.steps < kMaxSteps; ++impact.steps) {
    double distance = measure(time, tolerance);
    if (distance <= kTouch && tolerance > 0.0) distance = measure(time, 0.0);
    if (std::isnan(distance)) return ImpactTime();
    impact.time = time;
    if (distance <= kTouch) return impact;
    time += time_for(distance);
    if (time >= duration) {
      impact.time = std::numeric_limits<double>::infinity();
      return impact;
    }
    tolerance = std::min(kFirstTolerance, kRelativeTolerance * distance);
  }
  impact.converged = false;
  return impact;
}

}  // namespace ist
