#pragma once

#include <ros/time.h>

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

// What is missing, in words and as the status constants of ProximityArray. Pure functions.

/// All that is known about a source when it is judged. Times in seconds of the ROS clock, counted
/// since the start or the clock's last jump backwards.
struct SourceFacts {
  std::string name;
  std::string topic;  ///< resolved
  std::string type = "sensor_msgs/PointCloud2";
  std::string noun = "cloud";  ///< what one message is called
  bool is_file = false;        ///< `topic` is a file's path, read once and never stale
  double timeout = 0.5;        ///< [s]
  std::string timeout_parameter = "cloud_timeout";  ///< its name
  bool required = true;
  /// [m] how far from a link a point is taken for the robot: in that skin no obstacle is seen.
  /// NaN: without self-filter.
  double blind_skin = std::numeric_limits<double>::quiet_NaN();
  std::uint64_t messages = 0;      ///< received
  std::uint64_t out_of_order = 0;  ///< dropped: older than the cloud in use
  std::uint64_t overtaken = 0;     ///< dropped: a newer one was ready first
  std::uint64_t shown = 0;         ///< on ~filtered_cloud, which is made while somebody listens
  std::uint64_t unusable = 0;      ///< dropped: malformed, in the future, or without transform
  std::uint32_t publishers = 0;
  /// Newest stamp received, those far in the future aside; NaN: none.
  double newest = std::numeric_limits<double>::quiet_NaN();
  std::string problem;  ///< why the last message is not in use (yet); empty when it is

  bool has_snapshot = false;  ///< the rest is about the cloud in use
  ros::Time stamp;
  double ingest_time = 0.0;  ///< [s]
  IngestCounts counts;
};

/// A judgement: one of the status constants, and a sentence unless it is OK.
struct Verdict {
  std::uint8_t status;
  std::string text;
  bool ok() const { return status == 0; }
};

/// A stamp this much ahead of the clock is not believed. [s]
double future_tolerance(double timeout);

/// NO_CLOUD, STALE_CLOUD or OK; only a source that is OK may be used.
Verdict judge_source(const SourceFacts& source, double now);

/// All that decides the status of a ProximityArray.
struct Situation {
  std::string model_problem;             ///< not empty: there is no model (yet)
  std::vector<std::string> link_errors;  ///< monitored links without usable geometry
  std::vector<SourceFacts> sources;
  std::vector<Verdict> verdicts;           ///< of `sources`, one each
  std::vector<std::string> pose_problems;  ///< one sentence each
  bool deadline_passed = false;
  bool outside_region = false;  ///< a link is farther out than it can be
  bool clock_runs = true;       ///< false: simulated time, and no /clock yet
};

/// Whether the query may look at clouds: every required source is usable, and at least one is. A
/// partial view must not be shown as clear.
bool clouds_usable(const Situation& situation);

/// The first that applies: a model or link error; a required source without any message; one that
/// is stale; a missing pose; a required source whose messages cannot be used; a passed deadline;
/// OK. The text begins with what decided and goes on with the rest.
Verdict judge(const Situation& situation, double now);

}  // namespace ist
