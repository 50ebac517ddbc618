#pragma once

#include <ros/callback_queue.h>
#include <ros/node_handle.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "ist_proximity/cloud/ingest.h"
#include "ros/common/publisher_count.h"
#include "ros/input/measurement.h"
#include "ros/input/measurement_queue.h"
#include "ros/input/obstacle_source.h"
#include "ros/input/placer.h"
#include "ros/input/snapshot_exchange.h"
#include "ros/input/source_memory.h"
#include "ros/input/source_state.h"
#include "ros/input/topic_advice.h"
#include "ros/parameters/source_config.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// One sensor: receives its clouds, scans or maps and turns them into snapshots in a thread of its
/// own, so that neither a large cloud nor a late transform ever delays a query.
///
/// A cloud waits until tf knows the poses of its sensor and, for the self-filter, of the links at
/// the cloud's own stamp; a scan waits until the time of its last beam. The newest measurement that
/// is ready is used, and older ones are dropped. What waits is bounded by the timeout and by memory
/// (see MeasurementQueue). Links whose transforms have stopped are not waited
/// for (see Placer).
///
/// Messages are used in the order of their stamps. Where stamps go back (the sensor's driver or the
/// map server has started again, with another clock), that is a new start, and is told.
///
/// An exception in the thread becomes the source's problem, and the thread goes on.
///
/// A map is placed when a query asks for it, at the pose of its frame at that time, so that it
/// stays right on a robot that drives. The last map is kept for a model that is loaded later,
/// because it may never be sent again. A map file is read once, in this thread.
class CloudSource : public ObstacleSource {
 public:
  /// @returns [s] what it took
  using WarmUp = std::function<double(const ObstacleSource& source, const SourceSnapshot& fresh)>;

  /// @param nh        in the namespace that the topic is relative to
  /// @param buffer    outlives this
  /// @param filtered  publisher of what queries see, used while it has subscribers
  /// @param memory    what the source remembers; null: nothing
  /// @param warm_up   called by the source's thread with each cloud before queries get it
  CloudSource(const SourceConfig& config, ros::NodeHandle nh, const TransformBuffer& buffer,
              const ros::Publisher& filtered, std::shared_ptr<SourceMemory> memory, WarmUp warm_up);
  ~CloudSource() override;

  void set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                 const RegionOfInterest& region, const std::vector<bool>& filters) override;
  const SourceSnapshot* newest(const std::shared_ptr<const RobotModel>& model,
                               const ros::Time& time, double max_age) override;
  std::shared_ptr<const SourceSnapshot> share(const std::shared_ptr<const RobotModel>& model,
                                              const ros::Time& time, double max_age) override;
  void report(SourceReport* report) override;

 private:
  using MeasurementPtr = std::shared_ptr<const Measurement>;

  void run();
  std::string place(const ros::Time& time, double max_age, SourceSnapshot* map) const;
  void guard(const std::function<void()>& function);
  void read_file();
  void receive(const Received& received);
  std::string why_unusable(const Received& received) const;
  double went_back(const ros::Time& stamp) const;
  bool is_new_start(const ros::Time& stamp) const;
  void start_again(const ros::Time& stamp);
  std::string older_than_used(double seconds) const;
  void take_target();
  void drop_overdue();
  void use_newest_ready();
  void use_map();
  std::string ingest(const Measurement& measurement);
  void complete(const Measurement& measurement, const Placement& placement,
                SourceSnapshot* snapshot) const;
  void warm_up(const SourceSnapshot& snapshot);
  void note_view(const Placement& placement, const ViewReport& view);
  void count_publishers();

  const SourceConfig config_;
  const bool is_map_;
  const TransformBuffer& buffer_;
  ros::Publisher filtered_;
  const std::shared_ptr<SourceMemory> memory_;  ///< null: nothing is remembered
  const WarmUp warm_up_;
  ros::CallbackQueue queue_;
  Subscription subscription_;
  SnapshotExchange exchange_;
  SourceState state_;

  // Used by the thread that calls newest() alone.
  std::shared_ptr<const SourceSnapshot> map_;  ///< the original of placed_map_
  SourceSnapshot placed_map_;

  // Used by the source's thread alone.
  SourceTarget target_;
  Placer placer_;
  Ingest ingest_;
  MeasurementQueue waiting_;
  MeasurementPtr last_map_;
  bool map_is_new_ = false;    ///< last_map_ is not in use with this model yet
  ros::Time in_use_;           ///< stamp of the newest snapshot of this generation
  std::uint64_t content_ = 0;  ///< Received::content of the newest message
  std::chrono::steady_clock::time_point waits_since_;  ///< nothing waited, or one was ingested
  bool waits_for_tf_ = false;                          ///< the reported problem is that wait
  PublisherCount publisher_count_;
  TopicAdvice topic_advice_;
  bool has_received_ = false;
  std::atomic<bool> running_{true};
  std::thread thread_;
};

}  // namespace ist
