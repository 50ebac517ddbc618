#pragma once

#include <ros/time.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/input/source_report.h"
#include "ros/input/source_snapshot.h"

namespace ist {

/// A sensor or map as cycles and services see it.
class ObstacleSource {
 public:
  virtual ~ObstacleSource() = default;

  /// Sets what the next clouds are transformed to, filtered with and cropped at. Thread safe.
  /// @param model    null: clouds cannot be used
  /// @param filters  by link of the model: whether points on it are dropped
  virtual void set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                         const RegionOfInterest& region, const std::vector<bool>& filters) = 0;

  /// The newest snapshot made with `model` since the clock's last jump; null: none. It is valid
  /// until the next call and never waits. One thread only. Call report() afterwards, which explains
  /// why there is none.
  /// @param time     a map is placed where it is then, or else at the newest instant that tf knows
  /// @param max_age  [s] allowed age of that instant
  virtual const SourceSnapshot* newest(const std::shared_ptr<const RobotModel>& model,
                                       const ros::Time& time, double max_age) = 0;

  /// The same for any other thread; valid as long as it is held.
  virtual std::shared_ptr<const SourceSnapshot> share(
      const std::shared_ptr<const RobotModel>& model, const ros::Time& time, double max_age) = 0;

  /// Writes everything but the members about the cloud in use. A report that is used again keeps
  /// the memory of its strings. Thread safe.
  virtual void report(SourceReport* report) = 0;

  /// The source with whose snapshots this one's come while they are fresh, as
  /// SourceSnapshot::memory; null: none. The parent comes first in CloudSources.
  virtual const ObstacleSource* parent() const { return nullptr; }
};

using CloudSources = std::vector<std::shared_ptr<ObstacleSource>>;

}  // namespace ist
