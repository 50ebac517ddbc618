#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <tf2/buffer_core.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/snapshot_channel.h"
#include "ros/input/measurement.h"
#include "ros/output/publisher_count.h"
#include "ros/parameters/parameters.h"
#include "ros/status/status.h"

namespace ist {

/// A cloud as queries see it, and what it was made with.
struct SourceSnapshot {
  CloudSnapshot cloud;
  ros::Time stamp;
  std::shared_ptr<const RobotModel> model;
  /// By link: false where the self-filter had no pose at the cloud's stamp, so that points on that
  /// link are still among the obstacles. Empty: the source does not filter.
  std::vector<bool> filtered;
  std::uint64_t generation = 0;        ///< of the clock, see CloudSource; 0: none yet
  std::string fixed_frame, map_frame;  ///< what a map is placed with
};

/// One sensor: receives its clouds (or scans) and turns them into snapshots, in a thread of its
/// own, so that neither a large cloud nor a late transform ever delays a query.
///
/// A cloud waits until tf knows its sensor and, for the self-filter, the links at the cloud's own
/// stamp, a scan until its last beam's time; the newest one that is ready is taken, what it
/// overtakes is dropped. A link whose transforms have stopped is not waited for. This takes the
/// place of tf2_ros::MessageFilter, which can neither give up on a single frame (setTargetFrames()
/// needs clear(), which races with the tf listener's thread) nor say which transform it waits for.
///
/// A map is not placed here but where tf says that its frame is when a query asks, so that it stays
/// right on a robot that drives. The last one is kept for a model that is loaded later: it may
/// never be sent again. A map file is read once, in this thread.
///
/// When the ROS clock jumps back (a bag starts over), everything received before is forgotten, but
/// for maps that never become stale.
class CloudSource {
 public:
  /// @param nh        in the namespace that the topic is relative to
  /// @param buffer    outlives this
  /// @param filtered  where what queries see is published while somebody listens
  CloudSource(const SourceConfig& config, ros::NodeHandle nh, const tf2::BufferCore& buffer,
              const ros::Publisher& filtered);
  ~CloudSource();
  CloudSource(const CloudSource&) = delete;
  CloudSource& operator=(const CloudSource&) = delete;

  /// What clouds are transformed to, filtered with and cut at; null: they cannot be used. Thread
  /// safe.
  void set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                 const RegionOfInterest& region);

  /// The newest snapshot made with `model` since the clock's last jump; null: none. Valid until
  /// the next call. One thread only; never waits. Before facts(), which tells why there is none.
  /// @param time     a map is placed where it is then, or else at the newest instant that tf knows
  /// @param max_age  [s] of that instant
  const SourceSnapshot* newest(const std::shared_ptr<const RobotModel>& model,
                               const ros::Time& time, double max_age);

  /// The same for any other thread, for as long as it is held.
  std::shared_ptr<const SourceSnapshot> share(const std::shared_ptr<const RobotModel>& model,
                                              const ros::Time& time, double max_age);

  /// Everything but the snapshot's part. Thread safe.
  SourceFacts facts();

  const SourceConfig& config() const { return config_; }

 private:
  using Waiting = std::shared_ptr<const Measurement>;
  struct Target {
    std::shared_ptr<const RobotModel> model;
    std::string fixed_frame;
    RegionOfInterest region;
    std::uint64_t generation = 1;
  };

  void run();
  void receive(const Received& received);
  std::string why_unusable(const Received& received) const;
  Target target();
  void use_newest_ready();
  void use_kept();
  std::string place_map(const ros::Time& time, double max_age, SourceSnapshot* snapshot) const;
  bool is_for_ever() const;
  void forget_old();
  void count_publishers();
  std::string missing_transform(const Measurement& waiting) const;
  bool worth_waiting_for(const std::string& link, const ros::Time& stamp) const;
  std::string place(const Measurement& waiting, Placement* placement) const;
  std::string ingest(const Measurement& waiting);
  void pose_robot(const ros::Time& stamp, Placement* placement) const;
  std::shared_ptr<SourceSnapshot>& writable();
  bool is_current(const SourceSnapshot* snapshot, const std::shared_ptr<const RobotModel>& model);
  void notice_clock_jump();  ///< with mutex_ held
  void set_problem(const std::string& problem, bool dropped);

  const SourceConfig config_;
  const bool is_map_;
  const tf2::BufferCore& buffer_;
  ros::Publisher filtered_;
  ros::CallbackQueue queue_;
  ros::Subscriber subscriber_;
  SnapshotChannel<std::shared_ptr<SourceSnapshot>> channel_;

  std::mutex mutex_;  // for what follows, held for copies only
  Target shared_target_;
  SourceFacts facts_;
  std::string file_problem_, placing_problem_;  ///< these do not pass with the next message
  ros::Time last_now_;
  std::shared_ptr<const SourceSnapshot> shared_;  ///< the newest

  // The thread that calls newest() alone.
  std::shared_ptr<const SourceSnapshot> map_;  ///< what placed_map_ is a copy of
  SourceSnapshot placed_map_;                  ///< where its frame was at last

  // The source's thread alone.
  Target target_;
  Ingest ingest_;
  std::deque<Waiting> waiting_;  ///< by stamp
  Waiting kept_;                 ///< the last map
  bool kept_is_new_ = false;     ///< it is not in use with this model yet
  ros::Time in_use_;             ///< stamp of the newest snapshot of this generation
  std::chrono::steady_clock::time_point target_since_;
  std::chrono::steady_clock::time_point waits_since_;  ///< nothing waited, or one was ingested
  bool waits_for_tf_ = false;                          ///< which is the problem that is told
  PublisherCount publisher_count_;
  std::atomic<bool> running_{true};
  std::thread thread_;
};

}  // namespace ist
