#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/message_event.h>
#include <ros/node_handle.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <mutex>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "ros/poses/frame_statements.h"
#include "ros/poses/transform_gaps.h"

namespace ist {

/// A tf buffer that checks transforms before tf2 does, and remembers what was wrong with them.
///
/// tf2 logs every transform that it refuses, and nobody can ask it afterwards why a frame has no
/// fresh pose. Here the reason stays for a second after the last refusal, or until the publisher
/// has sent two good ones, and goes to the status: also where others give the frame a pose. A
/// static transform is sent once, so the reason of its refusal stays until another takes its place.
/// The buffer also remembers which transforms were stamped ahead of the clock, so that their age
/// counts from their receipt, and which frames two publishers state differently (see
/// FrameStatements). Where a dispute ends, the static transform that is left counts. What was
/// static stays so in tf2, for which it never is old: where /tf or joint states move it from then
/// on, its pose is in dispute until it is static again. Thread safe.
class TransformBuffer : public tf2::BufferCore {
 public:
  /// @param cache_time   how long transforms are kept
  /// @param longest_gap  [s] see gap()
  explicit TransformBuffer(const ros::Duration& cache_time,
                           double longest_gap = std::numeric_limits<double>::infinity())
      : tf2::BufferCore(cache_time), longest_gap_(longest_gap) {}

  /// Takes what comes on /tf and /tf_static, in the thread of the node handle's callback queue.
  void subscribe(ros::NodeHandle nh);

  /// Does not use what comes of these frames from now on, because joint states supply them. Static
  /// transforms that differ from the URDF's are disputes all the same.
  void ignore(const std::vector<std::string>& child_frames);

  /// Forgets everything but static transforms if the ROS clock has jumped back since the last call
  /// or message (a bag starts over). A transform from before that comes after it would be taken for
  /// the newest, and the present ones refused as too old.
  void notice_clock_jump();
  void clear();

  /// Adds a transform, unless it is refused: numbers that are no rotation or not finite, no frame
  /// names, no stamp, a stamp more than a second ahead of the clock.
  /// @param publisher  that sent it
  /// @param now        the ROS clock's time
  /// @returns empty, or a sentence that says why the transform is not used
  std::string add(const geometry_msgs::TransformStamped& transform,
                  const TransformPublisher& publisher, bool is_static, const ros::Time& now);

  /// Compares a static transform that is not to be used with the static ones of its frame.
  void compare(const geometry_msgs::TransformStamped& transform,
               const TransformPublisher& publisher, const ros::Time& now);

  /// Forgets that a publisher states anything; its transforms stay.
  void withdraw(const std::string& publisher);

  /// Ends the disputes that are over.
  void end_disputes(const ros::Time& now);

  /// The last refusal of the last second, or else of a static transform whose place is still empty,
  /// or ahead(); empty when there was none.
  std::string problem() const;
  /// A sentence on the transform that is farthest ahead of the clock, where that is 50 ms or more;
  /// empty when there was none in the last second.
  std::string ahead() const;

  /// Why transforms between a frame and another above it have been refused in the last second, or
  /// static ones at any time; empty when none was, which costs nothing.
  /// @param fixed  where the way up ends, if it is on the way
  std::string why_refused(const std::string& fixed, const std::string& frame) const;

  /// Counts the static transforms that have been replaced by others: what stands there was moved,
  /// or was somewhere else all the time. One that is being replaced is waited for: a pose that is
  /// looked up after the count is not older than it.
  std::uint64_t static_changes() const;
  /// Whether one between two frames is among those since static_changes() was `since`. It costs
  /// nothing when there is none.
  bool has_static_change(const std::string& fixed, const std::string& frame,
                         std::uint64_t since) const;

  /// Says that two publishers state a transform between two frames differently, and since when;
  /// empty where none is in dispute. It costs nothing while there is no dispute at all.
  std::string dispute(const std::string& fixed, const std::string& frame) const;

  /// Says that a transform between two frames was silent about an instant for longer than the
  /// longest gap, and has moved meanwhile; empty where none was. It costs nothing while there is no
  /// such gap at all.
  std::string gap(const std::string& fixed, const std::string& frame,
                  const ros::Time& instant) const;

  /// The instant from which the age of a pose counts: its stamp, or the receipt of a transform
  /// between the two frames that was stamped ahead of the clock.
  ros::Time counts_from(const std::string& fixed, const std::string& frame,
                        const ros::Time& stamp) const;

 private:
  using Clock = std::chrono::steady_clock;

  /// Knowledge of the transforms of one child frame.
  struct Record {
    std::string parent;  ///< of the last transform, used or refused
    ros::Time newest;    ///< stamp of the newest transform
    double ahead = 0.0;  ///< [s] of the newest one's stamp at its receipt; may be negative
    ros::Time received;  ///< receipt of the newest transform
    Clock::time_point ahead_until;
    std::string refusal, refused_publisher;
    Clock::time_point refused_until;  ///< the largest there is: of a static one, not sent again
    int good_since = 0;               ///< transforms of that publisher that were used since
    FrameStatements statements;
    TransformGaps gaps;
    geometry_msgs::TransformStamped newest_static;
    std::uint64_t static_change = 0;  ///< number of its last one; 0: it has had none
    bool is_static_in_tf = false;     ///< tf2 has it without time, whatever comes later
    std::string frozen;               ///< a sentence: it moves all the same; empty: it does not

    bool is_refused_for_good() const { return refused_until == Clock::time_point::max(); }
  };

  void receive(const ros::MessageEvent<const tf2_msgs::TFMessage>& event, bool is_static);
  bool is_ignored(const std::string& child_frame) const;
  static std::string why_unusable(const geometry_msgs::TransformStamped& transform, bool is_static,
                                  const ros::Time& now);
  std::string note(const geometry_msgs::TransformStamped& transform,
                   const TransformPublisher& publisher, bool is_static, const ros::Time& now,
                   bool* is_new);
  std::string refuse(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
                     const std::string& fault, bool is_static);
  template <typename Change>
  void change_statements(const Change& change, Record* record);
  void note_gap(const geometry_msgs::TransformStamped& transform, Record* record);
  void note_static_change(Record* record);
  void note_turn(const geometry_msgs::TransformStamped& transform,
                 const TransformPublisher& publisher, bool is_static, Record* record);
  Record* find_or_make(const std::string& child);
  void forget_moving();
  bool way_up(const std::string& end, const std::string& frame,
              std::vector<std::string>* way) const;
  std::vector<const Record*> between(const std::string& fixed, const std::string& frame) const;

  const double longest_gap_;                         ///< [s]
  mutable std::mutex mutex_;                         // guards the members below
  std::unordered_map<std::string, Record> records_;  ///< by child frame, without a slash
  std::string last_refusal_;
  std::atomic<std::size_t> lasting_refusals_{0};  ///< records that are refused for good
  std::atomic<Clock::time_point> refused_until_{Clock::time_point()};  ///< the last one
  bool any_ahead_ = false;  ///< whether a record has been ahead since the last clear()
  std::atomic<std::size_t> disputes_{0};  ///< records with a dispute, and those that are frozen
  std::atomic<std::size_t> gaps_{0};      ///< of all records
  std::atomic<std::uint64_t> static_changes_{0};  ///< of all records
  ros::Time last_now_;
  std::set<std::string> ignored_;

  ros::Subscriber moving_, static_;
};

}  // namespace ist
