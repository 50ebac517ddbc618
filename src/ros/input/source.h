#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/subscriber.h>
#include <ros/time.h>

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/input/snapshot_exchange.h"
#include "ros/input/source_report.h"
#include "ros/parameters/source_config.h"
#include "ros/poses/transform_buffer.h"
#include "ros/poses/transforms.h"

namespace ist {

/// A request for the snapshot of a source, by a cycle or a service.
struct SnapshotRequest {
  std::shared_ptr<const RobotModel> model;  ///< that the snapshot has to be made with
  ros::Time time;        ///< a map is placed where it is then, or else at the newest known instant
  double max_age = 0.0;  ///< [s] allowed age of that instant
  std::string root;      ///< see PoseSource::newest_root(); empty: frames are looked up in frame F
  Eigen::Isometry3d X_FR = Eigen::Isometry3d::Identity();  ///< used with `root`
};

/// Looks up where a frame is for a request, as look_up_near() does. With a root the frame is taken
/// to be where it was last in the root's frame. Where it is late, it may move on as it did in that
/// frame or as in frame F: those are two lags.
/// @param fixed  frame F
/// @param X_FB   receives the pose of the frame
std::string look_up_for(const SnapshotRequest& request, const TransformBuffer& buffer,
                        const std::string& fixed, const std::string& frame, Eigen::Isometry3d* X_FB,
                        std::array<Lag, 2>* lags);

/// A source of obstacles as cycles and services see it.
class ObstacleSource {
 public:
  virtual ~ObstacleSource() = default;

  /// The newest snapshot since the clock's last jump; null: none. It is valid until the next call
  /// and never waits. One thread only. Call report() afterwards, which explains why there is none.
  virtual const SourceSnapshot* newest(const SnapshotRequest& request) = 0;

  /// The same for any other thread; valid as long as it is held.
  virtual std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& request) = 0;

  /// Writes everything but the members about the cloud in use. A report that is used again keeps
  /// the memory of its strings. Thread safe.
  virtual void report(SourceReport* report) = 0;

  /// Whether it is the memory of the source just before it in CloudSources. While that one is
  /// fresh, its snapshots bring those of the memory along, as SourceSnapshot::memory.
  virtual bool is_memory() const { return false; }
};

using CloudSources = std::vector<std::shared_ptr<ObstacleSource>>;

/// The number of the source that a memory belongs to; of a source that is no memory, its own.
inline std::size_t parent_of(const CloudSources& sources, std::size_t source) {
  return sources[source]->is_memory() ? source - 1 : source;
}

/// The frame of what stands still in the fixed frame, whatever that is.
constexpr const char* kFixedFrame = "(fixed frame)";

/// The robot and the frame that a source's clouds are made for. Clouds are transformed to the fixed
/// frame, filtered with the robot's model and cropped to the region of interest.
struct SourceTarget {
  std::shared_ptr<const RobotModel> model;  ///< null: clouds cannot be used
  std::string fixed_frame;
  RegionOfInterest region;
  std::vector<bool> filters;     ///< by link of the model: whether points on it are dropped
  std::uint64_t generation = 1;  ///< counts the backward jumps of the clock
  double set_back = 0.0;         ///< [s] all of them together

  /// Whether clouds that were made for another target's robot serve this one's.
  bool is_same_robot(const SourceTarget& other) const {
    return model == other.model || (model && other.model && same_geometry(*model, *other.model));
  }
};

/// The common part of sensors, maps and known worlds: a topic whose messages are turned into
/// snapshots by a thread of its own, so that neither a large message nor a late transform ever
/// delays a query, and the report about it. The lock is held for copies only.
///
/// When the ROS clock jumps back (a bag starts over), snapshots from before are no longer current,
/// except for those of a source that is permanent.
class Source : public ObstacleSource {
 public:
  /// Sets what the next clouds are transformed to, filtered with and cropped at. Thread safe.
  /// @param model    null: clouds cannot be used
  /// @param filters  by link of the model: whether points on it are dropped
  void set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                 const RegionOfInterest& region, const std::vector<bool>& filters);

  const SourceSnapshot* newest(const SnapshotRequest& request) override;
  std::shared_ptr<const SourceSnapshot> share(const SnapshotRequest& request) override;
  void report(SourceReport* report) override;

 protected:
  /// @param nh      in the namespace that the topic is relative to
  /// @param buffer  outlives this
  /// @param own     a topic of the node itself, no advice to anybody
  Source(const SourceConfig& config, const ros::NodeHandle& nh, const TransformBuffer& buffer,
         const std::string& own);

  /// Begins run() in the thread, which a derived class does last, and ends it, which its destructor
  /// does.
  void start();
  void stop();
  /// The thread's work, until running_ is false.
  virtual void run() = 0;
  SourceTarget newest_target();
  /// Changes the report under the lock.
  template <typename Change>
  void update(const Change& change) {
    const std::lock_guard<std::mutex> lock(mutex_);
    change(&report_);
  }
  /// Sets the problem of the newest message; empty clears it.
  /// @param dropped  whether the message counts as unusable
  void set_problem(const std::string& problem, bool dropped);
  /// Brackets the reading and ingesting of a message, which a status names where it takes too long.
  void begin_work();
  void end_work();
  /// Counts the publishers twice a second, and advises until the first message. The master may take
  /// long to answer.
  /// @returns their number when it is due
  std::optional<std::uint32_t> count_publishers();

  const SourceConfig config_;
  const TransformBuffer& buffer_;
  ros::CallbackQueue queue_;
  std::vector<ros::Subscriber> subscribers_;  ///< the first one to messages; empty: no topic
  SnapshotExchange exchange_;
  std::atomic<bool> running_{true};

  // Used by the source's thread alone.
  SourceTarget target_;
  bool has_received_ = false;

 private:
  std::string place(const SnapshotRequest& request, const SourceSnapshot& original,
                    SourceSnapshot* placed) const;
  std::string why_misplaced(const SourceSnapshot& cloud) const;
  std::string doubt_of_place(const SourceSnapshot& snapshot) const;
  bool is_current(const SourceSnapshot* snapshot, const std::shared_ptr<const RobotModel>& model);
  void notice_clock_jump();

  const bool is_placed_when_asked_;  ///< a map or world, which stays right on a robot that drives

  // Used by the thread that calls newest() alone.
  std::shared_ptr<const SourceSnapshot> original_;  ///< of placed_
  SourceSnapshot placed_;

  using Clock = std::chrono::steady_clock;

  // Used by the source's thread alone.
  const std::string own_topic_;
  Clock::time_point next_count_, next_advice_;

  std::mutex mutex_;  ///< guards the members below
  SourceTarget newest_target_;
  SourceReport report_;
  std::string placing_problem_;  ///< it stays until it is set again, whatever messages come
  ros::Time last_now_;
  static constexpr Clock::time_point kNoWork = Clock::time_point::min();
  Clock::time_point work_since_ = kNoWork;

  std::thread thread_;
};

}  // namespace ist
