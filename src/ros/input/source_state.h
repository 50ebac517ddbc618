#pragma once

#include <ros/time.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/cloud/view_filter.h"
#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/robot/robot_model.h"
#include "ros/input/source_report.h"
#include "ros/input/source_snapshot.h"
#include "ros/parameters/source_config.h"

namespace ist {

/// The robot and the frame that a source's clouds are made for. Clouds are transformed to the fixed
/// frame, filtered with the robot's model and cropped to the region of interest.
struct SourceTarget {
  std::shared_ptr<const RobotModel> model;  ///< null: clouds cannot be used
  std::string fixed_frame;
  RegionOfInterest region;
  std::vector<bool> filters;     ///< by link of the model: whether points on it are dropped
  std::uint64_t generation = 1;  ///< counts the backward jumps of the clock
  double set_back = 0.0;         ///< [s] all of them together
};

/// The state that a source's thread and its readers share. The lock is held for copies only.
/// Thread safe.
///
/// When the ROS clock jumps back (a bag starts over), snapshots from before are no longer current,
/// except for maps that are permanent.
class SourceState {
 public:
  /// @param topic  resolved
  SourceState(const SourceConfig& config, const std::string& topic);

  void set_target(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                  const RegionOfInterest& region, const std::vector<bool>& filters);
  SourceTarget target();

  /// Whether a snapshot was made with `model`, or one of the same geometry, since the clock's last
  /// jump.
  bool is_current(const SourceSnapshot* snapshot, const std::shared_ptr<const RobotModel>& model);

  /// Everything but the members about the cloud in use; see ObstacleSource::report().
  void report(SourceReport* report);
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
  /// Sets a problem with a map's file, or with its place in the fixed frame and a doubt about it.
  /// They stay until they are set again, whatever messages come.
  void set_file_problem(const std::string& problem);
  void set_placing(const std::string& problem, const std::string& doubt);

 private:
  void notice_clock_jump();

  const bool is_permanent_;
  std::mutex mutex_;
  SourceTarget target_;
  SourceReport report_;
  std::string file_problem_, placing_problem_;
  ros::Time last_now_;
  using Clock = std::chrono::steady_clock;
  Clock::time_point work_since_ = kNoWork;
  static constexpr Clock::time_point kNoWork = Clock::time_point::min();
};

/// A sentence when the points on the robot say that the sensor's pose in tf is wrong; else empty.
std::string doubt_of_view(const ViewReport& view);

}  // namespace ist
