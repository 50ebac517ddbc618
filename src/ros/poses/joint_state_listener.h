#pragma once

#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// A joint's newest position that could be used, and what is wrong with newer ones.
struct JointPosition {
  /// [rad, m]; NaN and stamp 0 until a message states it.
  double q = std::numeric_limits<double>::quiet_NaN();
  double velocity = std::numeric_limits<double>::quiet_NaN();  ///< [rad/s, m/s] NaN: not stated
  /// The stamp of the message; the receipt where that is ahead of the clock. Never goes back.
  ros::Time stamp;
  ros::Time sent;        ///< the message's stamp
  double spacing = 0.0;  ///< [s] usual time between two stamps; 0: not known yet
  /// [rad/s, m/s] Its mean rate between the last two stamps, and between those before; NaN: not
  /// known yet.
  double rate = std::numeric_limits<double>::quiet_NaN();
  double rate_before = std::numeric_limits<double>::quiet_NaN();
  double interval = 0.0, interval_before = 0.0;  ///< [s] between those stamps
  /// Another joint that was in the same message; itself when there was none.
  std::size_t companion = 0;
  std::shared_ptr<const std::string> refusal;  ///< why the newest sample is not used; null: it is
  bool is_missing =
      false;            ///< the newest message had new positions of other joints, not of this one
  bool strays = false;  ///< a mimic joint that was elsewhere than where its leader puts it
  bool is_implausible = false;  ///< far outside the joint's limits
};
using JointPositions = std::vector<JointPosition>;  ///< by joint of the kinematics

/// Counts of joint states for the diagnostics, since the kinematics was set.
struct JointStateReport {
  std::string topic;             ///< resolved
  std::uint32_t publishers = 0;  ///< connected publishers
  std::uint64_t messages = 0;    ///< received messages
  std::uint64_t used = 0;        ///< messages with at least one new position
  std::uint64_t dropped = 0;     ///< positions that could not be used
  std::uint64_t skipped = 0;     ///< used messages without an answer: too many came
  std::string problem;           ///< the last one of the last second; empty when there was none
};

/// Receives joint_states in the thread of the node handle's callback queue and keeps each joint's
/// newest position.
///
/// Messages may hold some of the joints only, from any number of publishers. A faulty message or
/// position (sizes that differ, NaN, a joint that the URDF lacks or that is stated twice, a stamp
/// of 0 or of the future, more names than any robot has) is dropped; positions that are known
/// already stay, with the reason why no newer one is used. A position outside the joint's limits is
/// used and reported, because the robot is there. A stamp that is ahead of the clock by up to a
/// second counts from its receipt.
///
/// A mimic joint that is stated is where it is stated, also where its leader puts it elsewhere,
/// which is reported. Once a second has passed without a statement, it follows its leader again,
/// unless the two differed.
///
/// Every joint's pose also goes into a tf buffer, which interpolates it at the stamps of clouds,
/// combines it with all other frames (cameras on links, the frame in which the robot stands), and
/// tells where two publishers disagree.
///
/// Every message with a new position waits until take_next() takes it, so that results answer each
/// of them, also after a moment without a processor. Where ten wait already, the robot has gone on
/// too far: those are dropped.
///
/// When the ROS clock jumps back, all positions are forgotten. Thread safe.
class JointStateListener {
 public:
  /// kTaken: the positions just after the message that take_next() took last.
  enum class Which { kNewest, kTaken };

  /// @param buffer    outlives this
  /// @param nh        in the namespace that the topic is relative to
  /// @param topic     of the joint states
  /// @param prefix    of the links' frames in the buffer
  /// @param on_state  called from the listener's thread after each message with a new position
  JointStateListener(TransformBuffer* buffer, ros::NodeHandle nh, const std::string& topic,
                     std::string prefix, std::function<void()> on_state);
  JointStateListener(const JointStateListener&) = delete;
  JointStateListener& operator=(const JointStateListener&) = delete;

  /// Sets the joints that messages are read for. Null: messages are ignored. A change makes the
  /// listener forget all positions.
  void set_kinematics(std::shared_ptr<const Kinematics> kinematics);

  /// Gives the positions by joint; none when messages are read for another kinematics.
  void read(Which which, const Kinematics& kinematics, JointPositions* positions);

  /// Whether a message waits for take_next().
  bool is_waiting();
  /// Takes the oldest message that waits, or the newest positions when none does.
  void take_next();

  /// Gives the resolved topic, without waiting for the master.
  std::string topic();
  /// Gives the counts. It can wait for the master, which the cycle must not.
  JointStateReport report();

 private:
  /// A position that a message states.
  struct Stated {
    std::size_t joint;
    double q, velocity;
    std::string fault;  ///< why it cannot be used; empty: it can
  };

  void receive(const ros::MessageEvent<const sensor_msgs::JointState>& event);
  bool use_message(const sensor_msgs::JointState& message, const std::string& publisher);
  std::string why_unusable(const sensor_msgs::JointState& message) const;
  void collect(const sensor_msgs::JointState& message, bool complains);
  void collect_joint(std::size_t joint, double q, double velocity);
  void refuse(std::size_t joint, const std::string& reason);
  ros::Time counted_stamp(const ros::Time& stamp);
  void use(const Stated& stated, const ros::Time& stamp, const std::string& publisher);
  void follow(std::size_t leader, double q, const ros::Time& stamp, const std::string& publisher);
  void compare_with_leader(std::size_t joint);
  void put_into_tf(std::size_t joint, double q, const ros::Time& stamp,
                   const std::string& publisher);
  void notice_clock_jump();
  void forget();
  void drop(const std::string& problem, std::size_t count);

  TransformBuffer& buffer_;
  const std::string prefix_;
  const std::string urdf_;  ///< the name of who states the fixed joints
  const std::function<void()> on_state_;
  ros::Subscriber subscriber_;

  std::mutex mutex_;  // guards the members below; held for copies and one message only
  std::shared_ptr<const Kinematics> kinematics_;
  std::shared_ptr<const Kinematics> in_tf_;  ///< that put joints into tf last; null: none has
  std::unordered_map<std::string, std::size_t> index_;  ///< index of a joint by its name
  std::vector<std::vector<std::size_t>> led_by_;        ///< by joint: the joints that mimic it
  JointPositions newest_, taken_;
  std::deque<JointPositions> waiting_;  ///< after each message that is not answered yet
  std::vector<Stated> stated_;          ///< the positions of the message being read
  std::vector<std::size_t> place_;      ///< by joint: its place in stated_; else kNowhere
  JointStateReport report_;
  std::chrono::steady_clock::time_point problem_time_;
  ros::Time last_now_;
};

/// The frames whose poses come from joint states, so that tf's are not needed: the child links of
/// all joints but planar and floating ones.
std::vector<std::string> computed_frames(const Kinematics& kinematics);

}  // namespace ist
