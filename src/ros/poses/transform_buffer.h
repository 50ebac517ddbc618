#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/datatypes.h>
#include <ros/time.h>
#include <tf2/buffer_core.h>

#include <array>
#include <atomic>
#include <boost/weak_ptr.hpp>
#include <chrono>
#include <cstddef>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

#include "ros/poses/publisher_track.h"

namespace ist {

/// A tf buffer that checks transforms before tf2 does, and remembers what was wrong with them.
///
/// tf2 logs every transform that it refuses, and nobody can ask it afterwards why a frame has no
/// fresh pose. Here the reason stays for a second after the last refusal, or until the publisher
/// has sent two good ones, and goes to the status: also where others give the frame a pose. A
/// static transform is sent once, so the reason of its refusal stays until another takes its place.
/// The buffer also remembers which transforms were stamped ahead of the clock, so that their age
/// counts from their receipt.
///
/// It notices which frames two publishers state differently: in two parents, at places that no
/// motion explains (see PublisherTrack), or, where one of them is static, more than rounding apart.
/// What a publisher says last counts, so that a correction is no dispute. A dispute ends when they
/// agree, when the one has been silent for a second, or for three of its periods if that is longer,
/// and with the connection of a static publisher. The static transform that is left counts then.
/// Thread safe.
class TransformBuffer : public tf2::BufferCore {
 public:
  /// @param cache_time  how long transforms are kept
  explicit TransformBuffer(const ros::Duration& cache_time) : tf2::BufferCore(cache_time) {}

  /// A node that states transforms.
  struct Publisher {
    Publisher(std::string name_of_node)
        : name(std::move(name_of_node)) {}                       // NOLINT: a name will do
    Publisher(const char* name_of_node) : name(name_of_node) {}  // NOLINT: likewise
    Publisher(std::string name_of_node, const boost::shared_ptr<ros::M_string>& header)
        : name(std::move(name_of_node)), connection(header), has_connection(header != nullptr) {}

    std::string name;
    /// The header of its connection, which roscpp frees with the connection.
    boost::weak_ptr<ros::M_string> connection;
    bool has_connection = false;  ///< false: it is there for good

    bool is_gone() const { return has_connection && connection.expired(); }
  };

  /// Adds a transform, unless it is refused: numbers that are no rotation or not finite, no frame
  /// names, no stamp, a stamp more than a second ahead of the clock.
  /// @param publisher  that sent it
  /// @param now        the ROS clock's time
  /// @returns empty, or a sentence that says why the transform is not used
  std::string add(const geometry_msgs::TransformStamped& transform, const Publisher& publisher,
                  bool is_static, const ros::Time& now);

  /// Compares a static transform that is not to be used with the static ones of its frame.
  void compare(const geometry_msgs::TransformStamped& transform, const Publisher& publisher,
               const ros::Time& now);

  /// Forgets that a publisher states anything; its transforms stay.
  void withdraw(const std::string& publisher);

  /// Ends the disputes that are over.
  void end_disputes(const ros::Time& now);

  /// Forgets everything but static transforms.
  void clear();

  /// The last refusal of the last second, or else of a static transform whose place is still empty;
  /// empty when there was none.
  std::string last_refusal() const;
  /// A sentence on the transform that is farthest ahead of the clock, where that is 50 ms or more;
  /// empty when there was none in the last second.
  std::string ahead() const;

  /// Why transforms between a frame and another above it have been refused in the last second, or
  /// static ones at any time; empty when none was, which costs nothing.
  /// @param fixed  where the way up ends, if it is on the way
  std::string why_refused(const std::string& fixed, const std::string& frame) const;

  /// Says that two publishers state a transform between two frames differently, and since when;
  /// empty where none is in dispute. It costs nothing while there is no dispute at all.
  std::string dispute(const std::string& fixed, const std::string& frame) const;

  /// The instant from which the age of a pose counts: its stamp, or the receipt of a transform
  /// between the two frames that was stamped ahead of the clock.
  ros::Time counts_from(const std::string& fixed, const std::string& frame,
                        const ros::Time& stamp) const;

 private:
  using Clock = std::chrono::steady_clock;

  /// What a publisher said last of one child frame.
  struct Statement {
    Publisher publisher;
    bool is_static;
    geometry_msgs::TransformStamped transform;
    ros::Time received;
    double silence = 0.0;  ///< [s] after which it says nothing any more; not of a static one
  };

  /// Knowledge of the transforms of one child frame.
  struct Record {
    std::string parent;  ///< of the last transform, used or refused
    ros::Time newest;    ///< stamp of the newest transform
    double ahead = 0.0;  ///< [s] of the newest one's stamp at its receipt; may be negative
    ros::Time received;  ///< receipt of the newest transform
    Clock::time_point ahead_time;
    std::string refusal, refused_publisher;
    Clock::time_point refusal_time;
    int good_since = 0;          ///< transforms of that publisher that were used since
    bool refusal_stays = false;  ///< of a static transform, which is not sent again
    PublisherTrack track;
    std::vector<Statement> statements;  ///< by publisher, in the order of their first ones
    std::string dispute;                ///< empty: none
    std::array<std::string, 2> rivals;  ///< by the track, which disagree until then
    ros::Time rivals_until;
  };

  std::string check(const geometry_msgs::TransformStamped& transform, bool is_static,
                    const ros::Time& now) const;
  std::string refuse(const geometry_msgs::TransformStamped& transform, const std::string& publisher,
                     const std::string& fault, bool is_static);
  static void note_good(const std::string& publisher, Record* record);
  void accept(const std::string& child);
  void note_statement(const geometry_msgs::TransformStamped& transform, const Publisher& publisher,
                      bool is_static, const ros::Time& now, Record* record);
  static std::string why_disagreeing(const Statement& a, const Statement& b,
                                     const std::array<std::string, 2>& rivals);
  void compare_statements(const ros::Time& now, Record* record);
  void set_dispute(const std::string& dispute, Record* record);
  bool way_up(const std::string& end, const std::string& frame,
              std::vector<std::string>* way) const;
  std::vector<std::string> between(const std::string& fixed, const std::string& frame) const;

  mutable std::mutex mutex_;                         // guards the members below
  std::unordered_map<std::string, Record> records_;  ///< by child frame, without a slash
  std::string last_refusal_;
  std::atomic<std::size_t> lasting_refusals_{0};  ///< records whose refusal stays
  std::atomic<Clock::time_point> last_refusal_time_{Clock::time_point()};
  Clock::time_point skew_time_;
  bool any_ahead_ = false;  ///< whether a record has been ahead since the last clear()
  std::atomic<std::size_t> disputes_{0};  ///< records with a dispute
};

}  // namespace ist
