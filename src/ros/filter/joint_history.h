#pragma once

#include <ros/time.h>
#include <sensor_msgs/JointState.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// Joint positions of the last second, from any number of publishers. Not thread safe.
class JointHistory {
 public:
  explicit JointHistory(std::shared_ptr<const Kinematics> kinematics);

  /// Takes the positions of a message that can be used: names and positions of one size, finite,
  /// one for a joint, a stamp that is not 0, not older than the last one of the joint and not ahead
  /// of the clock by more than kMaxAhead; those that are ahead by more than kClockResolution are
  /// taken for present ones, as by a node that reads joint states. A node that reads tf has them
  /// where they are stamped. Others stay as they are.
  void add(const sensor_msgs::JointState& message, const ros::Time& now);
  /// Forgets everything: the clock has gone back.
  void clear();

  /// The positions [rad, m] by joint of the kinematics at an instant, between those that are stated
  /// of a joint by a straight line; the newest one after it. A joint that is not stated is NaN.
  /// @param moved  may be null; [rad, m] by joint: how far its newest position is from that one,
  ///               from those before it that a node may have held until then, and from where it
  ///               was by the stamps of a clock that is ahead
  /// @returns false where the history of a joint does not reach back to the instant
  bool at(const ros::Time& stamp, std::vector<double>* q,
          std::vector<double>* moved = nullptr) const;

  /// The newest position [rad, m] of a joint; NaN: not known.
  double newest(std::size_t joint) const;

  /// [rad/s, m/s] A joint's mean velocity over the last `window` [s] > 0 before its newest
  /// position, or a little longer. NaN where the history does not reach back so far.
  double velocity(std::size_t joint, double window) const;

  /// [s] since the oldest of the newest positions, of joints with a position of their own and of
  /// mimic joints that are stated.
  double age(const ros::Time& now) const;

  /// A sentence about a joint with a position of its own that is not known, or about one, mimic
  /// joints included, that was stated more than `timeout` [s] ago; empty: there is none.
  std::string late_joint(const ros::Time& now, double timeout) const;

 private:
  struct Sample {
    ros::Time stamp, sent;  ///< that counts, and as it came
    double q;               ///< [rad, m]
    std::uint64_t message;  ///< its number
  };
  using Samples = std::deque<Sample>;

  static void append(Sample sample, Samples* samples);
  bool is_needed(std::size_t joint) const;
  bool is_of_one_message(const ros::Time& stamp) const;
  bool note_ahead(const Samples& samples, const ros::Time& stamp, double* moved) const;

  std::shared_ptr<const Kinematics> kinematics_;
  std::vector<Samples> samples_;         ///< by joint, in the order of their stamps
  std::uint64_t messages_ = 0;           ///< that were taken
  std::vector<std::uint64_t> disputed_;  ///< by joint: the last message that has stated it twice
  bool any_ahead_ = false;               ///< a sample was sent by a clock that is ahead
};

}  // namespace ist
