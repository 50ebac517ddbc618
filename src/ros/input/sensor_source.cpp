#include "ros/input/sensor_source.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>
#include <utility>

#include "ros/common/exceptions.h"
#include "ros/common/frame_name.h"
#include "ros/common/publish.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

// Clouds of one stream may overtake each other; stamps that go back farther are a new start. [s]
constexpr double kMaxDisorder = 1.0;
// [s] For so long the sensors on a topic are remembered at most.
constexpr double kSensorMemory = 10.0;
// Characters of a frame's name, which every status that mentions it repeats.
constexpr std::size_t kMaxFrameName = 256;
const ros::WallDuration kPollIdle(0.05), kPollTaken(0.005), kPollTf(0.0005);

/// Stamps that are farther ahead of the clock are not believed. [s]
double future_tolerance(double timeout) { return std::min(timeout, kMaxAhead); }

/// The end of a sentence about a measurement that waits for tf: its clock may be the reason.
std::string clock_difference(const Measurement& measurement) {
  const double ahead = seconds_between(measurement.counts_from(), measurement.header.stamp);
  if (ahead < kToldSkew) return "";
  return format_text("; its stamp is %.3f s ahead of the clock", ahead);
}

}  // namespace

SensorSource::SensorSource(const SourceConfig& config, ros::NodeHandle nh,
                           const TransformBuffer& buffer, const ZoneStore& zones,
                           const ros::Publisher& filtered, std::shared_ptr<SourceMemory> memory,
                           WarmUp warm_up)
    : Source(config, nh, buffer, filtered.getTopic()),
      is_map_(config.type == SourceType::kMap),
      noun_(noun(config.type)),
      zones_(zones),
      filtered_(filtered),
      memory_(std::move(memory)),
      warm_up_(std::move(warm_up)),
      ingest_(ingest_config(config)),
      zone_ingest_(ingest_config(config)) {
  nh.setCallbackQueue(&queue_);
  if (config.file.empty()) {
    subscribers_ = subscribe(config, &nh, [this](const std::function<Measurement()>& read) {
      guard([&] {
        if (is_map_) begin_work();  // others are read in no time
        Measurement measurement = read();
        if (is_map_) end_work();
        receive(std::move(measurement));
      });
    });
  }
  start();
}

void SensorSource::run() {
  if (!config_.file.empty()) {
    guard([this] {
      last_map_ = std::make_shared<Measurement>(
          read_map_file(config_.file, without_slash(config_.frame_id), config_.map));
      map_is_new_ = last_map_->fault.empty();
      set_problem(last_map_->fault, false);
      if (!map_is_new_) last_map_.reset();
    });
  }
  while (running_) {
    // Before the next message is read, so that the new one can use the memory of an old one.
    const bool is_taken = exchange_.release_unused();
    const ros::WallDuration idle = is_taken ? kPollIdle : kPollTaken;
    guard([&] { queue_.callAvailable(waiting_.empty() ? idle : kPollTf); });
    guard([this] {
      take_target();
      const std::size_t dropped = waiting_.drop_overdue(ros::Time::now(), config_.timeout);
      if (dropped > 0) update([&](SourceReport* report) { report->unusable += dropped; });
      place_newest();
      use_map();
      if (memory_) memory_->grow_older();
      count_publishers();
    });
  }
}

/// Calls a function. An exception drops what waits, so that it is not met again and again: the
/// source goes stale unless other messages can be used.
void SensorSource::guard(const std::function<void()>& function) {
  const std::string fault = exception_of(function);
  if (fault.empty()) return;
  waiting_.clear();
  waits_for_tf_ = false;
  end_work();
  const std::string problem = "its " + noun_ + " could not be used: " + fault;
  set_problem(problem, true);
  ROS_ERROR_STREAM_THROTTLE(5.0, "source '" << config_.name << "': " << problem);
}

/// Takes the newest target, and drops measurements of another model or from before the clock's
/// jump.
void SensorSource::take_target() {
  SourceTarget newest = newest_target();
  const bool is_same_time = newest.generation == target_.generation;
  if (!is_same_time && !config_.is_permanent()) last_map_.reset();
  if (!is_same_time || !newest.model) waiting_.clear();
  if (!is_same_time || !newest.is_same_robot(target_)) {
    in_use_ = ros::Time();
    map_is_new_ = last_map_ != nullptr;
    target_since_ = std::chrono::steady_clock::now();
  }
  target_ = std::move(newest);
  if (memory_ && target_.model) memory_->begin_target(target_);
}

void SensorSource::receive(Measurement measurement) {
  has_received_ = true;
  take_target();
  const ros::Time stamp = measurement.header.stamp;
  std::string problem = check(measurement);
  if (problem.empty() && !is_map_) problem = note_sensor(measurement);
  const double ahead = seconds_between(ros::Time::now(), stamp);
  const bool is_believed = !stamp.isZero() && ahead <= future_tolerance(config_.timeout);
  if (is_believed) tell_skew(ahead);
  // A message that came later has an earlier stamp because the clock of its sender went back. Maps
  // come one by one, so that any earlier stamp says so. A message that is stale already does not
  // replace one that is not.
  if (problem.empty() && is_believed && went_back(stamp) > (is_map_ ? 0.0 : kMaxDisorder) &&
      -ahead <= config_.timeout) {
    start_again(stamp);
  }
  const bool is_same = measurement.content == content_;
  content_ = measurement.content;
  const bool is_used = problem.empty() && !(is_believed && stamp < in_use_);
  update([&](SourceReport* report) {
    ++report->messages;
    report->has_been_there = true;
    if (is_believed) {
      report->newest = std::fmax(report->newest, stamp.toSec() - std::fmax(ahead, 0.0));
      report->ahead = ahead;
    }
    if (content_ != 0 && !(is_same && report->same_since <= ros::Time::now().toSec())) {
      report->same_since = ros::Time::now().toSec();
    }
    if (is_believed && stamp < in_use_) {
      ++report->out_of_order;
      if (went_back(stamp) <= kMaxDisorder) return;
      report->problem = "its " + noun_ + "s " +
                        format_text("are stamped %.2f s before the one in use and are stale: ",
                                    went_back(stamp)) +
                        "has the sender's clock gone back?";
      return;
    }
    // The wait of other messages for tf remains a problem until one is used or this one is old.
    if (!waits_for_tf_ || ahead < -config_.timeout) report->problem.clear();
    report->doubt = measurement.doubt;
    if (problem.empty()) return;
    report->problem = problem;
    ++report->unusable;
    waits_for_tf_ = false;
  });
  if (is_used) keep(std::move(measurement));
}

void SensorSource::tell_skew(double ahead) const {
  if (ahead < kToldSkew) return;
  ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': its stamps are " << ahead
                                            << " s ahead of the clock; their age counts from "
                                               "their receipt; compare the clocks");
}

void SensorSource::keep(Measurement measurement) {
  auto kept = std::make_shared<const Measurement>(std::move(measurement));
  if (is_map_) {
    last_map_ = std::move(kept);
    map_is_new_ = true;
    return;
  }
  const std::size_t dropped = waiting_.add(std::move(kept));
  update([dropped](SourceReport* report) { report->unusable += dropped; });
}

/// Says why a message cannot be used; empty: it can.
std::string SensorSource::check(const Measurement& measurement) const {
  const std_msgs::Header& header = measurement.header;
  const std::string plural = "its " + noun_ + "s ";
  if (header.stamp.isZero()) return plural + "have no stamp (0): the driver must set header.stamp";
  const double ahead = seconds_between(ros::Time::now(), header.stamp);
  if (ahead > future_tolerance(config_.timeout)) {
    return plural + format_text("are stamped %.2f s in the future: ", ahead) +
           "compare the clocks of sensor and node";
  }
  const std::size_t name_length = header.frame_id.size();
  if (name_length == 0) return plural + "have an empty frame_id";
  if (name_length > kMaxFrameName) {
    return plural + "have a frame_id of " + std::to_string(name_length) +
           " characters, allowed are at most " + std::to_string(kMaxFrameName);
  }
  if (!measurement.fault.empty()) return measurement.fault;
  return target_.model || is_map_ ? "" : "it waits for the robot's model";
}

/// Each cloud takes the place of the one before, so that of several sensors only one would be seen
/// at a time. A sensor that gets another frame or node keeps it for longer than the timeout, or
/// 10 s; once they have come by turns, for those 10 s.
/// @returns empty, or why the messages of now, and the one in use, cannot be used
std::string SensorSource::note_sensor(const Measurement& measurement) {
  const std::string sensor =
      "'" + without_slash(measurement.header.frame_id) + "' (of " + measurement.publisher + ")";
  const ros::Time now = ros::Time::now();
  const double longest = std::min(config_.timeout, kSensorMemory);  // the timeout may be infinite
  if (sensor != sensor_) {
    sensor_before_ = std::exchange(sensor_, sensor);
    sensors_left_[sensor_before_] = now;
    const bool has_alternated =
        std::abs(seconds_between(sensors_alternate_until_, now)) < kSensorMemory;
    const double memory = has_alternated ? kSensorMemory : longest;
    for (auto left = sensors_left_.begin(); left != sensors_left_.end();) {
      const bool is_over = !(std::abs(seconds_between(left->second, now)) < memory);
      left = is_over ? sensors_left_.erase(left) : std::next(left);
    }
    if (sensors_left_.count(sensor) > 0) sensors_alternate_until_ = now + ros::Duration(longest);
  }
  // The clock may have gone back.
  const double left = seconds_between(now, sensors_alternate_until_);
  if (!(left > 0.0 && left <= longest)) return "";
  std::string problem =
      "its " + noun_ + "s come by turns in the frames " + std::min(sensor_, sensor_before_) +
      " and " + std::max(sensor_, sensor_before_) +
      ", so that one would hide the other: give each sensor a topic and a source of its own";
  waiting_.clear();
  update([&](SourceReport* report) { report->alternation = problem; });
  return problem;
}

/// [s] How much earlier a stamp is than the newest one that is in use or waits; negative: it is
/// later.
double SensorSource::went_back(const ros::Time& stamp) const {
  const ros::Time newest =
      waiting_.empty() ? in_use_ : std::max(in_use_, waiting_.newest().header.stamp);
  return newest.isZero() ? -1.0 : seconds_between(stamp, newest);
}

void SensorSource::start_again(const ros::Time& stamp) {
  ROS_WARN_STREAM_THROTTLE(
      5.0, "source '" << config_.name << "': the stamps of its " << noun_ << "s went "
                      << format_text("back by %.2f s", went_back(stamp))
                      << "; the sender has started again, and its messages are used from now on");
  waiting_.clear();
  in_use_ = ros::Time();
  update([](SourceReport* report) {
    ++report->restarts;
    report->newest = std::numeric_limits<double>::quiet_NaN();
  });
}

/// Uses the newest measurement whose poses are known. The wait for tf becomes a problem only when
/// the newest measurement has waited unusually long.
void SensorSource::place_newest() {
  const auto now = std::chrono::steady_clock::now();
  if (waiting_.empty()) {
    waits_since_ = now;
    return;
  }
  std::string wait;  // why the newest waits
  const std::size_t i = waiting_.newest_ready([&](const Measurement& measurement) {
    const std::string problem = missing_transform(measurement);
    if (&measurement == &waiting_.newest()) wait = problem;
    return problem.empty();
  });
  const std::chrono::duration<double> waits = now - waits_since_;
  if (!wait.empty() && waits.count() >= 0.5 * std::min(config_.timeout, 1.0)) {
    set_problem(wait + clock_difference(waiting_.newest()), false);
    waits_for_tf_ = true;
  }
  if (i == waiting_.size()) return;
  waits_since_ = now;
  begin_work();
  const std::string problem = use(waiting_[i]);
  end_work();
  waits_for_tf_ = false;
  set_problem(problem, !problem.empty());
  update([i](SourceReport* report) { report->overtaken += i; });
  waiting_.drop_until(i);
}

void SensorSource::use_map() {
  if (!last_map_ || !map_is_new_ || !target_.model) return;
  map_is_new_ = false;
  const std::string problem = use(*last_map_);
  set_problem(problem, !problem.empty());
}

/// Turns a measurement into the newest snapshot.
/// @returns empty on success, else a sentence
std::string SensorSource::use(const Measurement& measurement) {
  Placement placement;
  const std::uint64_t static_changes = buffer_.static_changes();
  std::string problem = find_poses(measurement, &placement);
  if (!problem.empty()) return problem;
  SourceSnapshot& snapshot = exchange_.writable();
  snapshot.static_changes = static_changes;
  const bool is_shown = !is_map_ && filtered_.getNumSubscribers() > 0;
  take_in(measurement, placement, is_shown, &snapshot);
  note_view(placement, snapshot.cloud.view);
  publish(snapshot, is_shown);
  return "";
}

/// A self-filter by view corrects the sensor's pose by what it has seen before: in another frame,
/// or since a sensor was calibrated, that pose is right or wrong in another way.
void SensorSource::begin_view(const std::string& frame) {
  const std::uint64_t changes = buffer_.static_changes();
  const bool is_same =
      frame == view_frame_ && !buffer_.has_static_change(target_.fixed_frame, frame, view_changes_);
  view_frame_ = frame;
  view_changes_ = changes;
  if (is_same || config_.ingest.self_filter_mode != SelfFilterMode::kView) return;
  ingest_ = Ingest(ingest_config(config_));
}

/// @param is_shown  on ~filtered_cloud, which is not cropped at the region of interest
void SensorSource::take_in(const Measurement& measurement, const Placement& placement,
                           bool is_shown, SourceSnapshot* snapshot) {
  begin_view(without_slash(measurement.header.frame_id));
  ingest_.set_region_of_interest(is_shown ? RegionOfInterest() : target_.region);
  PlacedZones zones;
  if (config_.has_zones()) zones = zones_.place(target_.fixed_frame, measurement.header.stamp);
  ingest_.set_zones(zones.zones);
  measurement.take_in(placement, &ingest_, &snapshot->cloud);
  take_in_zones(measurement, placement, zones, snapshot);
  if (is_map_) snapshot->cloud.box_extent = map_extent(config_);
  snapshot->stamp = measurement.header.stamp;
  snapshot->counts_from = measurement.counts_from();
  snapshot->model = target_.model;
  snapshot->fixed_frame = target_.fixed_frame;
  snapshot->map_frame = without_slash(measurement.header.frame_id);
  snapshot->filtered = placement.known;
  snapshot->generation = target_.generation;
  snapshot->memory = memory_ ? memory_->take(measurement, placement, target_, *snapshot) : nullptr;
  in_use_ = snapshot->stamp;
}

/// Takes in the points that zones have left out of the cloud: for the links that are not named, and
/// for a memory, which remembers them.
void SensorSource::take_in_zones(const Measurement& measurement, const Placement& placement,
                                 const PlacedZones& zones, SourceSnapshot* snapshot) {
  const bool is_empty = snapshot->cloud.counts.in_zones == 0;
  snapshot->zones = is_empty ? decltype(zones.live)() : zones.live;
  snapshot->in_zones.resize(is_empty ? 0 : zones.links.size());
  if (is_empty) return;
  zone_ingest_.set_region_of_interest(target_.region);
  for (std::size_t group = 0; group < zones.links.size(); ++group) {
    CloudSnapshot& cloud = snapshot->in_zones[group];
    cloud.not_for = zones.links[group];
    cloud.index.clear();
    if (cloud.not_for.empty() && !memory_) continue;
    zone_ingest_.set_zones(zones.zones, group);
    measurement.take_in(placement, &zone_ingest_, &cloud);
  }
}

/// Hands a snapshot to queries. A warm-up that fails makes the next answer slower, and no cloud is
/// lost for it. A map is placed when a query asks for it.
void SensorSource::publish(const SourceSnapshot& snapshot, bool is_shown) {
  if (is_shown) {
    publish_message(filtered_, to_message(snapshot.cloud, snapshot.stamp, target_.fixed_frame));
  }
  double took = 0.0;
  const std::string fault = exception_of([&] {
    if (!is_map_) took = warm_up_(*this, snapshot);
  });
  if (!fault.empty()) {
    ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': warm-up failed: " << fault);
  }
  update([&](SourceReport* report) {
    report->alternation.clear();
    report->shown += is_shown ? 1 : 0;
    report->warm_up_time = took;
  });
  exchange_.publish();
}

/// Notes what a self-filter by view found, and warns where it could not do its work.
void SensorSource::note_view(const Placement& placement, const ViewReport& view) {
  if (config_.ingest.self_filter_mode != SelfFilterMode::kView || placement.robot.empty()) return;
  if (!view.is_used) {
    ROS_WARN_STREAM_THROTTLE(
        60.0, "source '" << config_.name << "': self_filter_mode is view, but its " << noun_
                         << "s are no images seen from their frame's origin: the self-filter drops "
                            "all that is within its padding");
  } else if (view.has_drifted) {
    ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': " << doubt_of_view(view));
  }
  update([&](SourceReport* report) {
    report->view = view;
    report->view_links.resize(view.links.size());
    for (std::size_t i = 0; i < view.links.size(); ++i) {
      const InnerSphereTree* tree = placement.robot[view.links[i].solid].tree;
      for (const LinkModel& link : target_.model->links) {
        if (&link.tree == tree) report->view_links[i] = link.name;
      }
    }
  });
}

void SensorSource::report(SourceReport* report) {
  Source::report(report);
  if (memory_) report->incomplete = memory_->loss();
}

}  // namespace ist
