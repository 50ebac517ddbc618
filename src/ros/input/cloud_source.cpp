#include "ros/input/cloud_source.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "ros/common/exceptions.h"
#include "ros/common/frame_name.h"
#include "ros/common/publish.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/common/thread_name.h"
#include "ros/input/cloud_measurement.h"
#include "ros/input/map_measurement.h"
#include "ros/input/source_state.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

// Clouds of one stream may overtake each other; stamps that go back farther are a new start. [s]
constexpr double kMaxDisorder = 1.0;
// Characters of a frame's name, which every status that mentions it repeats.
constexpr std::size_t kMaxFrameName = 256;
const ros::WallDuration kPollIdle(0.05), kPollTaken(0.005), kPollTf(0.0005);

/// Stamps that are farther ahead of the clock are not believed. [s]
double future_tolerance(double timeout) { return std::min(timeout, kMaxAhead); }

/// The end of a sentence about a measurement that waits for tf: its clock may be the reason.
std::string clock_difference(const Measurement& measurement) {
  const double ahead = seconds_between(measurement.counts_from(), measurement.header().stamp);
  if (ahead < kToldSkew) return "";
  return format_text("; its stamp is %.3f s ahead of the clock", ahead);
}

}  // namespace

CloudSource::CloudSource(const SourceConfig& config, ros::NodeHandle nh,
                         const TransformBuffer& buffer, const ros::Publisher& filtered,
                         std::shared_ptr<SourceMemory> memory, WarmUp warm_up)
    : config_(config),
      is_map_(config.type == SourceType::kMap),
      buffer_(buffer),
      filtered_(filtered),
      memory_(std::move(memory)),
      warm_up_(std::move(warm_up)),
      state_(config, config.file.empty() ? nh.resolveName(config.topic) : config.file),
      placer_(config, buffer),
      ingest_(ingest_config(config)),
      topic_advice_(nh.resolveName(config.topic), message_type(config.type), filtered.getTopic()) {
  nh.setCallbackQueue(&queue_);
  if (config.file.empty()) {
    const auto begin = [this] {
      if (is_map_) state_.begin_work();  // others are read in no time
    };
    subscription_ = subscribe(config, &nh, begin, [this](const Received& received) {
      if (is_map_) state_.end_work();
      guard([&] { receive(received); });
    });
  }
  thread_ = std::thread(&CloudSource::run, this);
}

CloudSource::~CloudSource() {
  running_ = false;
  thread_.join();
  subscription_.messages.shutdown();
  subscription_.camera_info.shutdown();
}

void CloudSource::set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                            const RegionOfInterest& region, const std::vector<bool>& filters) {
  state_.set_target(std::move(model), fixed_frame, region, filters);
}

const SourceSnapshot* CloudSource::newest(const std::shared_ptr<const RobotModel>& model,
                                          const ros::Time& time, double max_age) {
  const std::shared_ptr<SourceSnapshot>& snapshot = exchange_.newest();
  if (!state_.is_current(snapshot.get(), model)) return nullptr;
  if (!is_map_) {
    const std::string dispute = buffer_.dispute(snapshot->fixed_frame, snapshot->map_frame);
    state_.set_placing(dispute, doubt_of_pose(buffer_, snapshot->fixed_frame, snapshot->map_frame));
    return dispute.empty() ? snapshot.get() : nullptr;
  }
  if (map_ != snapshot) {
    map_ = snapshot;
    placed_map_ = *snapshot;
  }
  const std::string problem = place(time, max_age, &placed_map_);
  state_.set_placing(problem,
                     doubt_of_pose(buffer_, placed_map_.fixed_frame, placed_map_.map_frame));
  return problem.empty() ? &placed_map_ : nullptr;
}

std::shared_ptr<const SourceSnapshot> CloudSource::share(
    const std::shared_ptr<const RobotModel>& model, const ros::Time& time, double max_age) {
  std::shared_ptr<const SourceSnapshot> snapshot = exchange_.share();
  if (!state_.is_current(snapshot.get(), model)) return nullptr;
  if (!is_map_) {
    const bool is_disputed = !buffer_.dispute(snapshot->fixed_frame, snapshot->map_frame).empty();
    return is_disputed ? nullptr : snapshot;
  }
  const auto placed = std::make_shared<SourceSnapshot>(*snapshot);
  return place(time, max_age, placed.get()).empty() ? placed : nullptr;
}

/// Looks up where a map's frame is at an instant, or else at the newest one that tf knows.
std::string CloudSource::place(const ros::Time& time, double max_age, SourceSnapshot* map) const {
  map->lags.resize(1);
  return look_up_near(buffer_, map->fixed_frame, map->map_frame, time, max_age, &map->cloud.X_FM,
                      &map->lags[0]);
}

void CloudSource::report(SourceReport* report) {
  state_.report(report);
  if (memory_) report->incomplete = memory_->loss();
}

void CloudSource::run() {
  name_thread("ist " + config_.name);
  guard([this] { read_file(); });
  while (running_) {
    // Before the next message is read, so that the new one can use the memory of an old one.
    const bool is_taken = exchange_.release_unused();
    const ros::WallDuration idle = is_taken ? kPollIdle : kPollTaken;
    guard([&] { queue_.callAvailable(waiting_.empty() ? idle : kPollTf); });
    guard([this] {
      take_target();
      drop_overdue();
      use_newest_ready();
      use_map();
      if (memory_) memory_->grow_older();
      count_publishers();
    });
  }
}

/// Calls a function. An exception drops what waits, so that it is not met again and again: the
/// source goes stale unless other messages can be used.
void CloudSource::guard(const std::function<void()>& function) {
  const std::string fault = exception_of(function);
  if (fault.empty()) return;
  waiting_.clear();
  state_.end_work();
  const std::string problem =
      std::string("its ") + noun(config_.type) + " could not be used: " + fault;
  state_.set_problem(problem, true);
  ROS_ERROR_STREAM_THROTTLE(5.0, "source '" << config_.name << "': " << problem);
}

void CloudSource::read_file() {
  if (config_.file.empty()) return;
  const Received received =
      read_map_file(config_.file, without_slash(config_.frame_id), config_.map);
  state_.set_file_problem(received.fault);
  last_map_ = received.measurement;
  map_is_new_ = last_map_ != nullptr;
}

void CloudSource::count_publishers() {
  const std::optional<std::uint32_t> publishers = publisher_count_.ask(subscription_.messages);
  if (!publishers) return;
  std::optional<std::string> advice;
  if (!has_received_) advice = topic_advice_.ask();
  state_.update([&](SourceReport* report) {
    report->publishers = *publishers;
    report->has_been_there |= *publishers > 0;
    if (advice) report->advice = *advice;
  });
}

/// Takes the newest target, and drops measurements of another model or from before the clock's
/// jump.
void CloudSource::take_target() {
  SourceTarget newest = state_.target();
  if (newest.generation != target_.generation) {
    waiting_.clear();
    if (!config_.is_permanent()) last_map_.reset();
  }
  const bool is_same_robot =
      newest.model == target_.model ||
      (newest.model && target_.model && same_geometry(*newest.model, *target_.model));
  if (newest.generation != target_.generation || !is_same_robot) {
    in_use_ = ros::Time();
    map_is_new_ = last_map_ != nullptr;
    placer_.begin_target();
  }
  target_ = std::move(newest);
  if (memory_ && target_.model) memory_->begin_target(target_);
  if (!target_.model) waiting_.clear();
}

/// Drops measurements that have waited so long that they are stale.
void CloudSource::drop_overdue() {
  const std::size_t dropped = waiting_.drop_overdue(ros::Time::now(), config_.timeout);
  if (dropped > 0) state_.update([&](SourceReport* report) { report->unusable += dropped; });
}

void CloudSource::receive(const Received& received) {
  has_received_ = true;
  take_target();
  drop_overdue();
  const ros::Time& stamp = received.header.stamp;
  const std::string problem = why_unusable(received);
  const double ahead = seconds_between(ros::Time::now(), stamp);
  const bool is_believed = !stamp.isZero() && ahead <= future_tolerance(config_.timeout);
  if (is_believed && ahead >= kToldSkew) {
    ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': its stamps are " << ahead
                                              << " s ahead of the clock; their age counts from "
                                                 "their receipt; compare the clocks");
  }
  if (problem.empty() && is_believed && is_new_start(stamp)) start_again(stamp);
  const bool is_same = received.content == content_;
  content_ = received.content;
  bool is_used = true;
  state_.update([&](SourceReport* report) {
    ++report->messages;
    report->has_been_there = true;
    if (is_believed) {
      report->newest = std::fmax(report->newest, stamp.toSec() - std::fmax(ahead, 0.0));
      report->ahead = ahead;
    }
    if (received.content != 0 && !(is_same && report->same_since <= ros::Time::now().toSec())) {
      report->same_since = ros::Time::now().toSec();
    }
    if (is_believed && stamp < in_use_) {
      ++report->out_of_order;
      if (went_back(stamp) > kMaxDisorder) report->problem = older_than_used(went_back(stamp));
      is_used = false;
      return;
    }
    // The wait of other messages for tf remains a problem until one is used or this one is old.
    if (!waits_for_tf_ || ahead < -config_.timeout) report->problem.clear();
    report->doubt = received.doubt;
    if (problem.empty()) return;
    report->problem = problem;
    ++report->unusable;
    waits_for_tf_ = false;
    is_used = false;
  });
  if (!is_used) return;
  if (is_map_) {
    last_map_ = received.measurement;
    map_is_new_ = true;
    return;
  }
  const std::size_t dropped = waiting_.add(received.measurement);
  if (dropped > 0) state_.update([&](SourceReport* report) { report->unusable += dropped; });
}

/// [s] How much earlier a stamp is than the newest one that is in use or waits; negative: it is
/// later.
double CloudSource::went_back(const ros::Time& stamp) const {
  const ros::Time newest =
      waiting_.empty() ? in_use_ : std::max(in_use_, waiting_.newest().header().stamp);
  return newest.isZero() ? -1.0 : seconds_between(stamp, newest);
}

/// Whether a message that came later has an earlier stamp because the clock of its sender went
/// back. Maps come one by one, so that any earlier stamp says so. A message that is stale already
/// does not replace one that is not.
bool CloudSource::is_new_start(const ros::Time& stamp) const {
  return went_back(stamp) > (is_map_ ? 0.0 : kMaxDisorder) &&
         seconds_between(stamp, ros::Time::now()) <= config_.timeout;
}

void CloudSource::start_again(const ros::Time& stamp) {
  ROS_WARN_STREAM_THROTTLE(
      5.0, "source '" << config_.name << "': the stamps of its " << noun(config_.type) << "s went "
                      << format_text("back by %.2f s", went_back(stamp))
                      << "; the sender has started again, and its messages are used from now on");
  waiting_.clear();
  in_use_ = ros::Time();
  state_.update([](SourceReport* report) {
    ++report->restarts;
    report->newest = std::numeric_limits<double>::quiet_NaN();
  });
}

std::string CloudSource::older_than_used(double seconds) const {
  return std::string("its ") + noun(config_.type) + "s " +
         format_text("are stamped %.2f s before the one in use and are stale: ", seconds) +
         "has the sender's clock gone back?";
}

std::string CloudSource::why_unusable(const Received& received) const {
  const ros::Time& stamp = received.header.stamp;
  const std::string plural = std::string("its ") + noun(config_.type) + "s ";
  if (stamp.isZero()) return plural + "have no stamp (0): the driver must set header.stamp";
  const double ahead = seconds_between(ros::Time::now(), stamp);
  if (ahead > future_tolerance(config_.timeout)) {
    return plural + format_text("are stamped %.2f s in the future: ", ahead) +
           "compare the clocks of sensor and node";
  }
  const std::size_t name_length = received.header.frame_id.size();
  if (name_length == 0) return plural + "have an empty frame_id";
  if (name_length > kMaxFrameName) {
    return plural + "have a frame_id of " + std::to_string(name_length) +
           " characters, allowed are at most " + std::to_string(kMaxFrameName);
  }
  if (!received.fault.empty()) return received.fault;
  if (!target_.model && !is_map_) return "it waits for the robot's model";
  return "";
}

/// Ingests the newest measurement whose poses are known. The wait for tf becomes a problem only
/// when the newest measurement has waited unusually long.
void CloudSource::use_newest_ready() {
  const auto now = std::chrono::steady_clock::now();
  if (waiting_.empty()) {
    waits_since_ = now;
    return;
  }
  std::string wait;  // why the newest waits
  const std::size_t i = waiting_.newest_ready([&](const Measurement& measurement) {
    const std::string problem = placer_.missing_transform(measurement, target_);
    if (&measurement == &waiting_.newest()) wait = problem;
    return problem.empty();
  });
  const std::chrono::duration<double> waits = now - waits_since_;
  if (!wait.empty() && waits.count() >= 0.5 * std::min(config_.timeout, 1.0)) {
    state_.set_problem(wait + clock_difference(waiting_.newest()), false);
    waits_for_tf_ = true;
  }
  if (i == waiting_.size()) return;
  waits_since_ = now;
  state_.begin_work();
  const std::string problem = ingest(waiting_[i]);
  state_.end_work();
  waits_for_tf_ = false;
  state_.set_problem(problem, !problem.empty());
  state_.update([i](SourceReport* report) { report->overtaken += i; });
  waiting_.drop_until(i);
}

void CloudSource::use_map() {
  if (!last_map_ || !map_is_new_ || !target_.model) return;
  map_is_new_ = false;
  const std::string problem = ingest(*last_map_);
  state_.set_problem(problem, !problem.empty());
}

/// Turns a measurement into the newest snapshot.
/// @returns empty on success, else a sentence
std::string CloudSource::ingest(const Measurement& measurement) {
  Placement placement;
  std::string problem = placer_.place(measurement, target_, &placement);
  if (!problem.empty()) return problem;
  SourceSnapshot& snapshot = exchange_.writable();
  // The published cloud is not cropped at the region of interest.
  const bool show = !is_map_ && filtered_.getNumSubscribers() > 0;
  ingest_.set_region_of_interest(show ? RegionOfInterest() : target_.region);
  try {
    measurement.ingest(placement, &ingest_, &snapshot.cloud);
  } catch (const std::exception& error) {  // no memory for a huge cloud
    snapshot.generation = 0;
    problem = std::string("the ") + noun(config_.type) + " could not be read: " + error.what();
    ROS_ERROR_STREAM_THROTTLE(5.0, "source '" << config_.name << "': " << problem);
    return problem;
  }
  if (is_map_) snapshot.cloud.box_extent = map_extent(config_);
  complete(measurement, placement, &snapshot);
  snapshot.memory = memory_ ? memory_->take(measurement, placement, target_, snapshot) : nullptr;
  note_view(placement, snapshot.cloud.view);
  in_use_ = snapshot.stamp;
  if (show) {
    publish_message(filtered_, to_message(snapshot.cloud, snapshot.stamp, target_.fixed_frame));
    state_.update([](SourceReport* report) { ++report->shown; });
  }
  if (!is_map_) warm_up(snapshot);  // a map is placed when a query asks for it
  exchange_.publish();
  return "";
}

/// A warm-up that fails makes the next answer slower, and no cloud is lost for it.
void CloudSource::warm_up(const SourceSnapshot& snapshot) {
  double took = 0.0;
  const std::string fault = exception_of([&] { took = warm_up_(*this, snapshot); });
  if (!fault.empty()) {
    ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': warm-up failed: " << fault);
  }
  state_.update([took](SourceReport* report) { report->warm_up_time = took; });
}

/// Notes what a self-filter by view found, and warns where it could not do its work.
void CloudSource::note_view(const Placement& placement, const ViewReport& view) {
  if (config_.ingest.self_filter_mode != SelfFilterMode::kView || placement.robot.empty()) return;
  if (!view.is_used) {
    ROS_WARN_STREAM_THROTTLE(
        60.0, "source '" << config_.name << "': self_filter_mode is view, but its "
                         << noun(config_.type)
                         << "s are no images seen from their frame's origin: the self-filter drops "
                            "all that is within its padding");
  } else if (view.has_drifted) {
    ROS_WARN_STREAM_THROTTLE(60.0, "source '" << config_.name << "': " << doubt_of_view(view));
  }
  state_.update([&](SourceReport* report) {
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

/// Notes what a snapshot was made with.
void CloudSource::complete(const Measurement& measurement, const Placement& placement,
                           SourceSnapshot* snapshot) const {
  snapshot->stamp = measurement.header().stamp;
  snapshot->counts_from = measurement.counts_from();
  snapshot->model = target_.model;
  snapshot->fixed_frame = target_.fixed_frame;
  snapshot->map_frame = without_slash(measurement.header().frame_id);
  // A link whose pose was missing at any instant is not filtered.
  snapshot->filtered = placement.known;
  snapshot->generation = target_.generation;
}

}  // namespace ist
