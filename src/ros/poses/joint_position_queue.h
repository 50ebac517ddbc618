#pragma once

#include <ros/time.h>

#include <chrono>
#include <cstddef>
#include <deque>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace ist {

/// A joint's newest position that could be used, and what is wrong with newer ones.
struct JointPosition {
  /// [rad, m]; NaN and stamp 0 until a message states it.
  double q = std::numeric_limits<double>::quiet_NaN();
  /// The stamp of the message; the receipt where that is ahead of the clock. Never goes back.
  ros::Time stamp;
  ros::Time sent;        ///< the message's stamp
  double spacing = 0.0;  ///< [s] usual time between two stamps; 0: not known yet
  /// Another joint that was in the same message; itself when there was none.
  std::size_t companion = 0;
  std::shared_ptr<const std::string> refusal;  ///< why the newest sample is not used; null: it is
  bool is_missing =
      false;            ///< the newest message had new positions of other joints, not of this one
  bool strays = false;  ///< a mimic joint that was elsewhere than where its leader puts it
  bool is_implausible = false;                 ///< far outside the joint's limits
  std::shared_ptr<const std::string> dispute;  ///< null unless two publishers have disagreed
  std::chrono::steady_clock::time_point dispute_time;
};
using JointPositions = std::vector<JointPosition>;  ///< by joint of the kinematics

/// The newest joint positions, and the positions after each message that is not answered yet. Not
/// thread safe.
class JointPositionQueue {
 public:
  /// Forgets all positions.
  void reset(std::size_t joints) {
    newest_.assign(joints, JointPosition());
    taken_ = newest_;
    waiting_.clear();
  }

  const JointPositions& newest() const { return newest_; }
  JointPosition& at(std::size_t joint) { return newest_[joint]; }

  /// Queues the newest positions. When kMaxWaiting wait already, the robot has gone on too far:
  /// those are dropped.
  /// @returns the number that was dropped
  std::size_t push() {
    const std::size_t dropped = waiting_.size() == kMaxWaiting ? waiting_.size() : 0;
    if (dropped > 0) waiting_.clear();
    waiting_.push_back(newest_);
    return dropped;
  }

  bool is_waiting() const { return !waiting_.empty(); }
  /// Takes the oldest positions that wait, or the newest ones when none do.
  void take_next() {
    if (waiting_.empty()) {
      taken_ = newest_;
      return;
    }
    taken_.swap(waiting_.front());
    waiting_.pop_front();
  }
  /// The positions taken last: messages before them count, later ones do not.
  const JointPositions& taken() const { return taken_; }

 private:
  static constexpr std::size_t kMaxWaiting = 10;
  JointPositions newest_, taken_;
  std::deque<JointPositions> waiting_;
};

}  // namespace ist
