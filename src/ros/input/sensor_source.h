#pragma once

#include <ros/publisher.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "ist_proximity/cloud/ingest.h"
#include "ros/input/measurement.h"
#include "ros/input/measurement_queue.h"
#include "ros/input/source.h"
#include "ros/input/source_memory.h"
#include "ros/input/zone_store.h"

namespace ist {

/// One sensor or map. The way of a cloud, image, scan or map is: received, checked, placed, taken
/// in, published, and then asked for by newest().
///
/// A cloud waits until tf knows the poses of its sensor and, for the self-filter, of the links at
/// the cloud's own stamp; a scan waits until the time of its last beam. The newest measurement that
/// is ready is used, and older ones are dropped. What waits is bounded by the timeout and by memory
/// (see MeasurementQueue). Links whose transforms have stopped are not waited for.
///
/// Messages are used in the order of their stamps. Where stamps go back (the sensor's driver or the
/// map server has started again, with another clock), that is a new start, and is told.
///
/// An exception in the thread becomes the source's problem, and the thread goes on.
///
/// A map is placed when a query asks for it. The last map is kept for a model that is loaded later,
/// because it may never be sent again. A map file is read once, in the source's thread.
class SensorSource : public Source {
 public:
  /// @returns [s] what it took
  using WarmUp = std::function<double(const ObstacleSource& source, const SourceSnapshot& fresh)>;

  /// @param nh        in the namespace that the topic is relative to
  /// @param buffer    outlives this
  /// @param zones     outlives this
  /// @param filtered  publisher of what queries see, used while it has subscribers
  /// @param memory    what the source remembers; null: nothing
  /// @param warm_up   called by the source's thread with each cloud before queries get it
  SensorSource(const SourceConfig& config, ros::NodeHandle nh, const TransformBuffer& buffer,
               const ZoneStore& zones, const ros::Publisher& filtered,
               std::shared_ptr<SourceMemory> memory, WarmUp warm_up);
  ~SensorSource() override { stop(); }

  void report(SourceReport* report) override;

 private:
  void run() override;
  void guard(const std::function<void()>& function);
  void take_target();
  void receive(Measurement measurement);
  void tell_skew(double ahead) const;
  void keep(Measurement measurement);
  std::string check(const Measurement& measurement) const;
  std::string note_sensor(const Measurement& measurement);
  double went_back(const ros::Time& stamp) const;
  void start_again(const ros::Time& stamp);
  void place_newest();
  void use_map();
  std::string use(const Measurement& measurement);
  void begin_view(const std::string& frame);
  void take_in(const Measurement& measurement, const Placement& placement, bool is_shown,
               SourceSnapshot* snapshot);
  void take_in_zones(const Measurement& measurement, const Placement& placement,
                     const PlacedZones& zones, SourceSnapshot* snapshot);
  void publish(const SourceSnapshot& snapshot, bool is_shown);
  std::string missing_transform(const Measurement& measurement) const;
  bool is_worth_waiting_for(const std::string& link, const ros::Time& stamp) const;
  std::string find_poses(const Measurement& measurement, Placement* placement) const;
  void pose_robot(const ros::Time& stamp, std::size_t instant, std::vector<std::size_t>* last,
                  Placement* placement) const;
  void note_view(const Placement& placement, const ViewReport& view);

  const bool is_map_;
  const std::string noun_;  ///< the word for one message
  const ZoneStore& zones_;
  ros::Publisher filtered_;
  const std::shared_ptr<SourceMemory> memory_;  ///< null: nothing is remembered
  const WarmUp warm_up_;

  // Used by the source's thread alone.
  Ingest ingest_, zone_ingest_;  ///< the latter of what is in zones
  MeasurementQueue waiting_;
  std::shared_ptr<const Measurement> last_map_;
  bool map_is_new_ = false;    ///< last_map_ is not in use with this model yet
  ros::Time in_use_;           ///< stamp of the newest snapshot of this generation
  std::uint64_t content_ = 0;  ///< Measurement::content of the newest message
  /// Frame and node of the newest message, and of another one before it.
  std::string sensor_, sensor_before_;
  std::string view_frame_;                         ///< of the clouds that ingest_ has seen,
  std::uint64_t view_changes_ = 0;                 ///< while so many static transforms had changed
  std::map<std::string, ros::Time> sensors_left_;  ///< when another one took a sensor's place
  ros::Time sensors_alternate_until_;
  std::chrono::steady_clock::time_point target_since_;  ///< with this model and generation
  std::chrono::steady_clock::time_point waits_since_;   ///< nothing waited, or one was ingested
  bool waits_for_tf_ = false;                           ///< the reported problem is that wait
};

}  // namespace ist
