#pragma once

#include <ros/time.h>
#include <visualization_msgs/MarkerArray.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/cloud/zone.h"
#include "ros/common/lifetime.h"
#include "ros/parameters/zone_config.h"
#include "ros/poses/transform_buffer.h"

namespace ist {

/// A zone since it was set. Thread safe.
class LiveZone {
 public:
  LiveZone(ZoneConfig config, const ros::Time& now)
      : config_(std::move(config)), lifetime_(config_.lifetime, now) {}

  /// Whether it is neither removed nor over.
  bool is_on(const ros::Time& now) const { return !is_removed_ && !lifetime_.is_over(now); }
  Lifetime& lifetime() { return lifetime_; }
  void remove() { is_removed_ = true; }
  const ZoneConfig& config() const { return config_; }

 private:
  const ZoneConfig config_;
  Lifetime lifetime_;
  std::atomic<bool> is_removed_{false};
};

/// The zones that hold at an instant, placed in the fixed frame.
struct PlacedZones {
  std::vector<Zone> zones;                            ///< group 0 is for all links
  std::vector<std::shared_ptr<const LiveZone>> live;  ///< by zone
  /// By group: the links for which its points are no obstacles. Empty: no links, for group 0.
  std::vector<std::vector<std::string>> links;
};

/// All zones. A zone whose frame is not known at an instant, nor was ~pose_timeout before it, is
/// off then. Thread safe.
class ZoneStore {
 public:
  /// @param buffer   outlives this
  /// @param max_age  [s] of the frames' poses
  /// @param zones    checked by zones_fault()
  ZoneStore(const TransformBuffer& buffer, double max_age, const std::vector<ZoneConfig>& zones);

  /// Sets a zone, in place of one of the same name; where that differs in its lifetime alone, it
  /// goes on.
  /// @returns why it cannot be used, and then all zones are as they were; else empty
  std::string set(const ZoneConfig& zone, const ros::Time& now);
  /// @returns whether there was one
  bool remove(const std::string& name);

  /// The zones that hold at an instant of the fixed frame.
  PlacedZones place(const std::string& fixed_frame, const ros::Time& time) const;

  /// A sentence for each zone that does not hold now, with the reason.
  std::vector<std::string> off(const std::string& fixed_frame, const ros::Time& now) const;
  /// The zones that were set and have not ended, for a person; empty: there are none.
  std::string summary(const ros::Time& now) const;
  /// The same for rviz, each in its frame, with the zone's name as namespace.
  visualization_msgs::MarkerArray markers(const ros::Time& now) const;

 private:
  std::vector<std::shared_ptr<LiveZone>> newest(const ros::Time& now) const;
  std::string look_up_zone(const std::string& fixed_frame, const LiveZone& zone,
                           const ros::Time& time, Eigen::Isometry3d* X_FB) const;

  const TransformBuffer& buffer_;
  const double max_age_;
  mutable std::mutex mutex_;
  std::vector<std::shared_ptr<LiveZone>> zones_;  ///< those for all links first, then by name
};

}  // namespace ist
