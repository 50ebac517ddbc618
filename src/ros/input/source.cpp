#include "ros/input/source.h"

#include <ros/master.h>
#include <ros/this_node.h>
#include <xmlrpcpp/XmlRpcValue.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/common/thread_name.h"

namespace ist {
namespace {

// Drivers start in their own time: the first answer would be out of date at once.
constexpr std::chrono::seconds kFirst{1}, kBetween{5};
constexpr std::size_t kMostTopics = 8;  // a status_text is meant to be read

// Whether a sensor or map sends it; objects of known worlds are no advice for those.
bool is_source_type(const std::string& type) {
  for (int i = 0; i < static_cast<int>(SourceType::kWorld); ++i) {
    if (type == message_type(static_cast<SourceType>(i))) return true;
  }
  return false;
}

std::string list(const std::vector<std::string>& names) {
  const std::size_t shown = std::min(names.size(), kMostTopics);
  std::string text =
      join({names.begin(), names.begin() + static_cast<std::ptrdiff_t>(shown)}, ", ");
  if (names.size() > shown) text += " and " + std::to_string(names.size() - shown) + " more";
  return text;
}

/// A sentence for somebody whose topic stays silent: that it has another type, or else which topics
/// a source could have.
/// @param own     a topic of the node itself, which is left out
/// @param topics  all that are published
std::string advice_on_topic(const std::string& topic, const std::string& type,
                            const std::string& own, const ros::master::V_TopicInfo& topics) {
  std::vector<std::string> same, others;
  for (const ros::master::TopicInfo& info : topics) {
    if (info.name == topic && info.datatype != type) {
      return is_source_type(info.datatype)
                 ? topic + " is a " + info.datatype +
                       ": give the source that type (~sources/NAME/" + "type), or another topic"
                 : topic + " is a " + info.datatype + ", which no source reads";
    }
    if (info.name == topic) return "";  // all is well, or about to be
    if (info.name == own || !is_source_type(info.datatype)) continue;
    (info.datatype == type ? same : others).push_back(info.name + " (" + info.datatype + ")");
  }
  std::sort(same.begin(), same.end());
  std::sort(others.begin(), others.end());
  same.insert(same.end(), others.begin(), others.end());
  return same.empty() ? "no topic that a source could have is published"
                      : "published are " + list(same);
}

std::string place_of(const SourceConfig& config, const ros::NodeHandle& nh) {
  const bool is_world = config.type == SourceType::kWorld;
  if (is_world ? config.world.has_topic : config.file.empty()) return nh.resolveName(config.topic);
  return config.file.empty() ? "~sources/" + config.name : config.file;
}

SourceReport report_of(const SourceConfig& config, const std::string& place) {
  const bool is_world = config.type == SourceType::kWorld;
  SourceReport report;
  report.name = config.name;
  report.is_file = is_world ? !config.world.has_topic : !config.file.empty();
  report.topic = place;
  report.type = message_type(config.type);
  report.noun = noun(config.type);
  report.timeout = config.timeout;
  report.timeout_parameter = config.timeout_parameter;
  report.required = config.required;
  report.measures = !is_world && !config.is_permanent();
  report.min_measured = kMinMeasured;
  report.frozen_after = config.frozen_after;
  report.sensor_range = std::max(config.ingest.sensor_range, config.ingest.max_range);
  if (config.ingest.self_filter) report.blind_skin = config.ingest.self_filter_padding;
  report.by_view =
      config.ingest.self_filter && config.ingest.self_filter_mode == SelfFilterMode::kView;
  return report;
}

/// Asks the master, unlike ros::master::getTopics() not waiting for one that is gone.
std::optional<ros::master::V_TopicInfo> published_topics() {
  XmlRpc::XmlRpcValue request, response, published;
  request[0] = ros::this_node::getName();
  request[1] = "";
  if (!ros::master::execute("getPublishedTopics", request, response, published, false)) {
    return std::nullopt;
  }
  ros::master::V_TopicInfo topics;
  for (int i = 0; i < published.size(); ++i) {
    topics.emplace_back(std::string(published[i][0]), std::string(published[i][1]));
  }
  return topics;
}

}  // namespace

std::string look_up_for(const SnapshotRequest& request, const TransformBuffer& buffer,
                        const std::string& fixed, const std::string& frame, Eigen::Isometry3d* X_FB,
                        std::array<Lag, 2>* lags) {
  auto& [in_F, in_R] = *lags;
  in_R.windows = 0;
  in_R.apart.setIdentity();
  std::string problem =
      look_up_near(buffer, fixed, frame, request.time, request.max_age, X_FB, &in_F);
  if (request.root.empty() || !problem.empty() || without_slash(frame) == without_slash(fixed)) {
    return problem;
  }
  Eigen::Isometry3d X_RB;
  problem = look_up_near(buffer, request.root, frame, request.time, request.max_age, &X_RB, &in_R);
  if (!problem.empty()) return problem;
  const Eigen::Isometry3d X_RF = request.X_FR.inverse(), last_F = *X_FB;
  *X_FB = request.X_FR * X_RB;
  in_F.apart = last_F * X_FB->inverse();
  for (std::size_t i = 0; i < in_R.windows; ++i)
    in_R.moved[i] = request.X_FR * in_R.moved[i] * X_RF;
  return "";
}

Source::Source(const SourceConfig& config, const ros::NodeHandle& nh, const TransformBuffer& buffer,
               const std::string& own)
    : config_(config),
      buffer_(buffer),
      is_placed_when_asked_(config.type == SourceType::kMap || config.type == SourceType::kWorld),
      own_topic_(own),
      next_advice_(Clock::now() + kFirst),
      report_(report_of(config, place_of(config, nh))) {}

void Source::start() {
  thread_ = std::thread([this] {
    name_thread("ist " + config_.name);
    run();
  });
}

void Source::stop() {
  running_ = false;
  thread_.join();
}

void Source::set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                       const RegionOfInterest& region, const std::vector<bool>& filters) {
  const std::lock_guard<std::mutex> lock(mutex_);
  newest_target_.model = std::move(model);
  newest_target_.fixed_frame = fixed_frame;
  newest_target_.region = region;
  newest_target_.filters = filters;
}

SourceTarget Source::newest_target() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  return newest_target_;
}

const SourceSnapshot* Source::newest(const SnapshotRequest& request) {
  const std::shared_ptr<SourceSnapshot>& snapshot = exchange_.newest();
  if (!is_current(snapshot.get(), request.model)) return nullptr;
  if (is_placed_when_asked_ && original_ != snapshot) {
    original_ = snapshot;
    placed_ = *snapshot;
  }
  std::string problem = place(request, *snapshot, &placed_);
  std::string doubt = doubt_of_place(*snapshot);
  const std::lock_guard<std::mutex> lock(mutex_);
  placing_problem_ = std::move(problem);
  report_.doubt_of_place = doubt.empty() ? report_.doubt_of_sender : std::move(doubt);
  if (!placing_problem_.empty()) return nullptr;
  return is_placed_when_asked_ ? &placed_ : snapshot.get();
}

std::shared_ptr<const SourceSnapshot> Source::share(const SnapshotRequest& request) {
  std::shared_ptr<const SourceSnapshot> snapshot = exchange_.share();
  if (!is_current(snapshot.get(), request.model)) return nullptr;
  std::shared_ptr<SourceSnapshot> placed;
  if (is_placed_when_asked_) placed = std::make_shared<SourceSnapshot>(*snapshot);
  if (!place(request, *snapshot, placed.get()).empty()) return nullptr;
  return placed ? placed : snapshot;
}

/// Looks up where the frames of objects and of a map are at an instant, or else at the newest one
/// that tf knows. A cloud is placed already, and only asked whether that still holds. Of a world,
/// what can be placed is left.
/// @param placed  receives it where the source is placed when asked
/// @returns empty, or why the snapshot cannot be used
std::string Source::place(const SnapshotRequest& request, const SourceSnapshot& original,
                          SourceSnapshot* placed) const {
  std::string problem = ended_zone(original, ros::Time::now());
  if (!problem.empty()) return problem;
  if (!is_placed_when_asked_) return why_misplaced(original);
  std::vector<Eigen::Isometry3d>& X_FB = placed->world.X_FB;
  placed->lags.resize(X_FB.size() + (original.cloud.boxes ? 1 : 0));
  placed->is_placed.resize(X_FB.size(), true);
  const auto place_frame = [&](const std::string& frame, std::array<Lag, 2>* lags,
                               Eigen::Isometry3d* X) {
    X->setIdentity();
    if (frame == kFixedFrame) return true;
    const std::string found = look_up_for(request, buffer_, original.fixed_frame, frame, X, lags);
    if (problem.empty()) problem = found;
    return found.empty();
  };
  bool has_changed = false;
  for (std::size_t i = 0; i < X_FB.size(); ++i) {
    const bool is_placed =
        place_frame(original.world.world->frames()[i], &placed->lags[i], &X_FB[i]);
    has_changed = has_changed || placed->is_placed[i] != is_placed;
    placed->is_placed[i] = is_placed;
  }
  if (has_changed) {
    placed->world.world =
        problem.empty() ? original.world.world : original.world.world->in_frames(placed->is_placed);
  }
  if (original.cloud.boxes) {
    Eigen::Isometry3d X_FM;
    const bool is_placed = place_frame(original.map_frame, &placed->lags.back(), &X_FM);
    placed->cloud.boxes = is_placed ? original.cloud.boxes : nullptr;
    placed->cloud.X_FM = X_FM * original.X_BM;
  }
  const bool has_rest =
      placed->cloud.boxes || (placed->surfaces && !placed->world.world->objects().empty());
  placed->unplaced = has_rest && !problem.empty() ? "some of it is left out: " + problem : "";
  return has_rest ? "" : problem;
}

/// Says why a cloud is not where it was placed; empty: it still is.
std::string Source::why_misplaced(const SourceSnapshot& cloud) const {
  if (buffer_.has_static_change(cloud.fixed_frame, cloud.map_frame, cloud.static_changes)) {
    return "the static transform from '" + cloud.map_frame + "' to '" + cloud.fixed_frame +
           "' is another one since the last " + noun(config_.type);
  }
  return buffer_.dispute(cloud.fixed_frame, cloud.map_frame);
}

/// The first doubt about where the frames of a snapshot are; empty: none.
std::string Source::doubt_of_place(const SourceSnapshot& snapshot) const {
  const std::string& fixed = snapshot.fixed_frame;
  for (std::size_t i = 0; i < snapshot.world.X_FB.size(); ++i) {
    const std::string& frame = snapshot.world.world->frames()[i];
    std::string doubt = frame == kFixedFrame ? "" : doubt_of_pose(buffer_, fixed, frame);
    if (!doubt.empty()) return doubt;
  }
  return snapshot.map_frame.empty() ? "" : doubt_of_pose(buffer_, fixed, snapshot.map_frame);
}

/// Whether a snapshot was made with `model`, or one of the same geometry, since the clock's last
/// jump.
bool Source::is_current(const SourceSnapshot* snapshot,
                        const std::shared_ptr<const RobotModel>& model) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  return snapshot && snapshot->model && model && same_geometry(*snapshot->model, *model) &&
         (snapshot->generation == newest_target_.generation || config_.is_permanent());
}

void Source::report(SourceReport* report) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  *report = report_;
  if (work_since_ != kNoWork) {
    report->working = std::chrono::duration<double>(Clock::now() - work_since_).count();
  }
  if (!placing_problem_.empty()) report->problem = placing_problem_;
}

void Source::set_problem(const std::string& problem, bool dropped) {
  const std::lock_guard<std::mutex> lock(mutex_);
  report_.problem = problem;
  if (dropped) ++report_.unusable;
}

void Source::begin_work() {
  const std::lock_guard<std::mutex> lock(mutex_);
  work_since_ = Clock::now();
}

void Source::end_work() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (work_since_ == kNoWork) return;
  report_.last_work = std::chrono::duration<double>(Clock::now() - work_since_).count();
  work_since_ = kNoWork;
}

std::optional<std::uint32_t> Source::count_publishers() {
  const Clock::time_point now = Clock::now();
  if (subscribers_.empty() || now < next_count_) return std::nullopt;
  next_count_ = now + std::chrono::milliseconds(500);
  const std::uint32_t publishers = subscribers_.front().getNumPublishers();
  std::optional<std::string> advice;
  if (!has_received_ && now >= next_advice_) {
    next_advice_ = now + kBetween;
    if (const auto topics = published_topics()) {
      advice = advice_on_topic(report_.topic, report_.type, own_topic_, *topics);
    }
  }
  update([&](SourceReport* report) {
    report->publishers = publishers;
    report->has_been_there |= publishers > 0;
    if (advice) report->advice = *advice;
  });
  return publishers;
}

/// The caller holds mutex_.
void Source::notice_clock_jump() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) {
    ++newest_target_.generation;
    newest_target_.set_back += seconds_between(now, last_now_);
    if (!config_.is_permanent()) {
      report_.messages = 0;
      report_.newest = report_.same_since = std::numeric_limits<double>::quiet_NaN();
      report_.problem.clear();
    }
  }
  last_now_ = now;
}

std::string doubt_of_view(const ViewReport& view) {
  if (!view.is_used || !view.has_drifted) return "";
  return format_text("its points on the robot are %.1f mm off, ", 1e3 * view.offset) +
         "more than three times what is usual for a sensor's pose: calibrate the sensor; until "
         "then its self-filter drops all that is within the padding";
}

}  // namespace ist
