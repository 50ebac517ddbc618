#pragma once

#include <ros/time.h>

#include <cstddef>
#include <deque>
#include <limits>
#include <vector>

namespace ist {

/// A joint's position [rad, m]; NaN and stamp 0 until a message states it.
struct JointPosition {
  double q = std::numeric_limits<double>::quiet_NaN();
  ros::Time stamp;
};
using JointPositions = std::vector<JointPosition>;  ///< by joint of the kinematics

/// The newest joint positions, and the positions after each message that is not answered yet. Not
/// thread safe.
class JointPositionQueue {
 public:
  /// Forgets all positions.
  void reset(std::size_t joints);

  const JointPositions& newest() const { return newest_; }
  void set(std::size_t joint, const JointPosition& position) { newest_[joint] = position; }

  /// Queues the newest positions. When ten wait already, the robot has gone on too far: those are
  /// dropped.
  /// @returns the number that was dropped
  std::size_t push();

  bool is_waiting() const { return !waiting_.empty(); }
  /// Takes the oldest positions that wait, or the newest ones when none do.
  void take_next();
  /// The positions taken last: messages before them count, later ones do not.
  const JointPositions& taken() const { return taken_; }

 private:
  JointPositions newest_, taken_;
  std::deque<JointPositions> waiting_;
};

}  // namespace ist
