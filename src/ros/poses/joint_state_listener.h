#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <tf2/buffer_core.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <limits>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/output/publisher_count.h"

namespace ist {

/// What came in, for diagnostics; counted since the kinematics was set.
struct JointStateFacts {
  std::string topic;             ///< resolved
  std::uint32_t publishers = 0;  ///< that are connected
  std::uint64_t messages = 0;    ///< received
  std::uint64_t used = 0;        ///< messages that told something new
  std::uint64_t dropped = 0;     ///< positions that could not be used
  std::uint64_t skipped = 0;     ///< used, but not answered: more came than could be
  std::string problem;           ///< during the last second; empty when there was none
};

/// Receives joint_states, in a thread of its own, and keeps each joint's newest position. Messages
/// may hold some of the joints only, from any number of publishers. What is wrong with one (sizes
/// that differ, NaN, a joint that the URDF lacks, a stamp of 0 or of the future) costs nothing that
/// is known already. A position outside the joint's limits is used, and said: the robot is there.
///
/// Every joint's pose goes into a tf buffer too, where it is found again at the stamps of clouds,
/// interpolated, with all that tf knows besides: cameras on links, the frame the robot stands in.
///
/// Every message that told something new waits for its turn, take_next(), so that what follows the
/// robot answers each of them, also after a moment without a processor. When ten wait, the robot
/// has gone on too far: they are skipped for the next one.
///
/// When the ROS clock jumps back, all positions are forgotten. Thread safe.
class JointStateListener {
 public:
  /// @param buffer   outlives this
  /// @param nh       in the namespace that `joint_states` is relative to
  /// @param on_state called from the listener's thread after each message that told something new
  JointStateListener(tf2::BufferCore* buffer, ros::NodeHandle nh, std::function<void()> on_state);
  ~JointStateListener();
  JointStateListener(const JointStateListener&) = delete;
  JointStateListener& operator=(const JointStateListener&) = delete;

  /// Null: messages are ignored. Another one than before: positions are forgotten.
  void set_kinematics(std::shared_ptr<const Kinematics> kinematics);

  struct Position {
    double q = std::numeric_limits<double>::quiet_NaN();  ///< [rad, m] NaN: never told
    ros::Time stamp;
  };
  /// By joint of `kinematics`; empty when that is not what messages are read with.
  void newest(const Kinematics& kinematics, std::vector<Position>* positions);

  /// Whether a message waits for its turn.
  bool is_waiting();
  /// To the oldest message that waits; to the newest positions when none does.
  void take_next();
  /// As newest(), just after the message that take_next() has come to. What came before it counts,
  /// what came after it does not.
  void taken(const Kinematics& kinematics, std::vector<Position>* positions);

  JointStateFacts facts();

 private:
  void receive(const sensor_msgs::JointStateConstPtr& message);
  bool read(const sensor_msgs::JointState& message);
  std::string why_unusable(const sensor_msgs::JointState& message) const;
  bool read_joint(const std::string& name, double q, const ros::Time& stamp);
  void put_into_tf(std::size_t joint, const ros::Time& stamp, bool is_static);
  void notice_clock_jump();
  void forget();
  void enqueue();
  void copy(const std::vector<Position>& from, const Kinematics& kinematics,
            std::vector<Position>* positions);
  void count_publishers();
  void drop(const std::string& problem, std::size_t count);

  tf2::BufferCore& buffer_;
  const std::function<void()> on_state_;
  ros::CallbackQueue queue_;
  ros::Subscriber subscriber_;

  std::mutex mutex_;  // for all that follows, held for copies and one message only
  std::shared_ptr<const Kinematics> kinematics_;
  std::unordered_map<std::string, std::size_t> index_;  ///< of a joint, by name
  std::vector<std::vector<std::size_t>> moved_by_;      ///< by joint: those that it moves
  std::vector<Position> positions_;                     ///< by joint
  std::vector<Position> taken_;                         ///< the same, at the turn of a message
  std::deque<std::vector<Position>> waiting_;           ///< the same, after each that waits
  JointStateFacts facts_;
  std::chrono::steady_clock::time_point problem_time_;
  ros::Time last_now_;

  PublisherCount publisher_count_;  // the listener's thread alone
  std::atomic<bool> running_{true};
  std::thread thread_;
};

/// Frames whose poses come from joint states, so that tf's are not needed: the child links of all
/// joints but planar and floating ones.
std::vector<std::string> computed_frames(const Kinematics& kinematics);

}  // namespace ist
