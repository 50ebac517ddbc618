#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Limits of a robot's joints, by column of ConstraintRows.
struct JointLimits {
  std::vector<double> speed;         ///< [rad/s, m/s] > 0, may be +inf
  std::vector<double> lower;         ///< [rad, m] of positions, may be -inf; empty: none
  std::vector<double> upper;         ///< [rad, m] the same, may be +inf
  std::vector<double> acceleration;  ///< [rad/s^2, m/s^2] > 0, may be +inf; empty: none
};

/// The limits that a URDF states, and a speed [rad/s, m/s] that no joint exceeds.
JointLimits joint_limits(const Kinematics& kinematics, double speed);

/// The outcome of a command.
enum class FilterStatus : std::uint8_t {
  kFree = 0,     ///< the command meets all bounds and is given as it is
  kLimited = 1,  ///< the nearest velocity that meets all bounds
  kScaled = 2,   ///< the command times the largest factor that meets the rows and joint limits
  kStopped = 3,  ///< 0, because no such factor is there
  kFault = 4,    ///< 0, because an input cannot be used
};

/// Why a filter did not give the nearest velocity.
enum class FilterReason : std::uint8_t {
  kNone = 0,           ///< it did
  kContradiction = 1,  ///< no velocity meets all bounds and acceleration limits
  kTime = 2,           ///< the time was over
  kCommand = 3,        ///< the command has another size than the joints, or is not finite
  kPositions = 4,      ///< q or `moved` has another size than the joints, or is not finite
  kRows = 5,           ///< the rows are not complete, of another size, or not numbers
};

/// The text for a person: one sentence. It lives as long as the program.
const char* sentence(FilterReason reason);

/// A velocity that may be commanded, and why.
struct FilterAnswer {
  std::vector<double> velocity;  ///< [rad/s, m/s] by joint; finite, whatever was given
  FilterStatus status = FilterStatus::kFault;  ///< what was made of the command
  FilterReason reason = FilterReason::kRows;   ///< why it is not the nearest velocity
  /// 0 to 1: the largest share of the command that meets the rows, speed and position limits; 0
  /// where there is none, and with a fault.
  double scale = 0.0;
  /// Rows that hold the velocity back, or that contradict one another; some twice.
  std::vector<std::size_t> rows;
  std::vector<std::size_t> joints;  ///< joints that are at a limit of theirs, likewise
  int iterations = 0;               ///< of the solver
};

/// One or two sentences for a person: what was done, why, and the links, sources and bounds of the
/// rows that decide. Allocates; not for the control loop.
/// @param rows   those that were given
/// @param pairs  ConstraintRowBuilder::pairs()
std::string describe(const FilterAnswer& answer, const ConstraintRows& rows,
                     const RobotModel& model, Span<const LinkPair> pairs = {});

/// The velocity nearest to a commanded one among those that meet ConstraintRows and the limits of
/// joints: the least sum of weight * (dq - command)^2.
///
/// Position limits: no joint passes its limit within the rows' horizon, and one that is beyond it
/// moves back only. Acceleration limits hold from the last answer to this one, within `period`.
///
/// The answer is the command times the largest factor from 0 to 1 that meets rows, speed and
/// position limits, or 0, where no velocity meets all bounds or the time is over; acceleration
/// limits give way to it. A row that asks for a retreat (h < 0) forbids it an approach alone, since
/// 0 would be none either. Nothing else that violates a row is given. Any fault of the input
/// gives 0.
///
/// run() allocates nothing, locks nothing and never throws. One object per thread.
class VelocityFilter {
 public:
  /// @param weights  by joint, > 0; empty: 1 each
  /// @param period   [s] > 0, of calls, for acceleration limits
  /// @throws std::invalid_argument naming the limit that contradicts another, or cannot be used
  explicit VelocityFilter(JointLimits limits, std::vector<double> weights = {},
                          double period = 0.01);
  ~VelocityFilter();
  VelocityFilter(VelocityFilter&&) noexcept;
  VelocityFilter& operator=(VelocityFilter&&) noexcept;

  /// @param command     [rad/s, m/s] by joint
  /// @param q           [rad, m] by joint, now
  /// @param rows        of ConstraintRowBuilder, for the poses at q
  /// @param time_limit  [s] after which the scaled command is given; 0: none
  /// @param moved       [rad, m] by joint: it is anywhere from q to q + moved, for the position
  ///                    limits; empty: at q
  /// @returns valid until the next call
  const FilterAnswer& run(Span<const double> command, Span<const double> q,
                          const ConstraintRows& rows, double time_limit = 0.0,
                          Span<const double> moved = {});

  /// Forgets the last velocity, for acceleration limits: the robot stands.
  void reset();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
