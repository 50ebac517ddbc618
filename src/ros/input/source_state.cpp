#include "ros/input/source_state.h"

#include <algorithm>
#include <limits>

#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {

SourceState::SourceState(const SourceConfig& config, const std::string& topic)
    : is_permanent_(config.is_permanent()) {
  report_.name = config.name;
  report_.is_file =
      config.type == SourceType::kWorld ? !config.world.has_topic : !config.file.empty();
  report_.topic = topic;
  report_.type = message_type(config);
  report_.noun = noun(config.type);
  report_.timeout = config.timeout;
  report_.timeout_parameter = config.timeout_parameter;
  report_.required = config.required;
  report_.measures = config.type != SourceType::kWorld && !config.is_permanent();
  report_.min_measured = config.min_measured;
  report_.frozen_after = config.frozen_after;
  report_.sensor_range = std::max(config.ingest.sensor_range, config.ingest.max_range);
  if (config.ingest.self_filter) report_.blind_skin = config.ingest.self_filter_padding;
  report_.by_view =
      config.ingest.self_filter && config.ingest.self_filter_mode == SelfFilterMode::kView;
}

void SourceState::set_target(std::shared_ptr<const RobotModel> model,
                             const std::string& fixed_frame, const RegionOfInterest& region,
                             const std::vector<bool>& filters) {
  const std::lock_guard<std::mutex> lock(mutex_);
  target_.model = std::move(model);
  target_.fixed_frame = fixed_frame;
  target_.region = region;
  target_.filters = filters;
}

SourceTarget SourceState::target() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  return target_;
}

bool SourceState::is_current(const SourceSnapshot* snapshot,
                             const std::shared_ptr<const RobotModel>& model) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  return snapshot && snapshot->model && model && same_geometry(*snapshot->model, *model) &&
         (snapshot->generation == target_.generation ||
          (snapshot->generation != 0 && is_permanent_));
}

void SourceState::report(SourceReport* report) {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  *report = report_;
  if (work_since_ != kNoWork) {
    report->working = std::chrono::duration<double>(Clock::now() - work_since_).count();
  }
  if (!placing_problem_.empty()) report->problem = placing_problem_;
  if (!file_problem_.empty()) report->problem = file_problem_;
}

void SourceState::set_problem(const std::string& problem, bool dropped) {
  const std::lock_guard<std::mutex> lock(mutex_);
  report_.problem = problem;
  if (dropped) ++report_.unusable;
}

void SourceState::begin_work() {
  const std::lock_guard<std::mutex> lock(mutex_);
  work_since_ = Clock::now();
}

void SourceState::end_work() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (work_since_ == kNoWork) return;
  report_.last_work = std::chrono::duration<double>(Clock::now() - work_since_).count();
  work_since_ = kNoWork;
}

void SourceState::set_file_problem(const std::string& problem) {
  const std::lock_guard<std::mutex> lock(mutex_);
  file_problem_ = problem;
}

void SourceState::set_placing(const std::string& problem, const std::string& doubt) {
  const std::lock_guard<std::mutex> lock(mutex_);
  placing_problem_ = problem;
  report_.doubt_of_place = doubt;
}

/// The caller holds mutex_.
void SourceState::notice_clock_jump() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) {
    ++target_.generation;
    target_.set_back += seconds_between(now, last_now_);
    if (!is_permanent_) {
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
         "more than three times what self_filter_view/position_error and angle_error say: "
         "calibrate "
         "the sensor; until then its self-filter drops all that is within the padding";
}

}  // namespace ist
