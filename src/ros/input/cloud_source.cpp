#include "ros/input/cloud_source.h"

#include <ros/console.h>
#include <ros/subscribe_options.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "ist_proximity/robot/posed_solids.h"
#include "ros/input/cloud_conversion.h"
#include "ros/input/map_measurement.h"
#include "ros/poses/transforms.h"
#include "ros/ros_time.h"
#include "ros/thread_name.h"

namespace ist {
namespace {

constexpr std::size_t kMaxWaiting = 10;
constexpr std::chrono::milliseconds kGrace(500);
const ros::WallDuration kPollIdle(0.05), kPollTf(0.002);

}  // namespace

CloudSource::CloudSource(const SourceConfig& config, ros::NodeHandle nh,
                         const tf2::BufferCore& buffer, const ros::Publisher& filtered)
    : config_(config),
      is_map_(config.type == SourceType::kMap),
      buffer_(buffer),
      filtered_(filtered),
      ingest_(ingest_config(config)) {
  facts_.name = config.name;
  facts_.is_file = !config.file.empty();
  facts_.topic = facts_.is_file ? config.file : nh.resolveName(config.topic);
  facts_.type = message_type(config.type);
  facts_.noun = noun(config.type);
  facts_.timeout = config.timeout;
  facts_.timeout_parameter = config.timeout_parameter;
  facts_.required = config.required;
  if (config.ingest.self_filter) facts_.blind_skin = config.ingest.self_filter_padding;
  nh.setCallbackQueue(&queue_);
  if (!facts_.is_file)
    subscriber_ = subscribe(config, &nh, [this](const Received& received) { receive(received); });
  thread_ = std::thread(&CloudSource::run, this);
}

CloudSource::~CloudSource() {
  running_ = false;
  thread_.join();
  subscriber_.shutdown();
}

void CloudSource::set_model(std::shared_ptr<const RobotModel> model, const std::string& fixed_frame,
                            const RegionOfInterest& region) {
  const std::lock_guard<std::mutex> lock(mutex_);
  shared_target_.model = std::move(model);
  shared_target_.fixed_frame = fixed_frame;
  shared_target_.region = region;
}

const SourceSnapshot* CloudSource::newest(const std::shared_ptr<const RobotModel>& model,
                                          const ros::Time& time, double max_age) {
  channel_.update();
  const std::shared_ptr<SourceSnapshot>& snapshot = channel_.front();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_current(snapshot.get(), model)) return nullptr;
  }
  if (!is_map_) return snapshot.get();
  if (map_ != snapshot) {
    map_ = snapshot;
    placed_map_ = *snapshot;
  }
  const std::string problem = place_map(time, max_age, &placed_map_);
  const std::lock_guard<std::mutex> lock(mutex_);
  placing_problem_ = problem;
  return problem.empty() ? &placed_map_ : nullptr;
}

std::shared_ptr<const SourceSnapshot> CloudSource::share(
    const std::shared_ptr<const RobotModel>& model, const ros::Time& time, double max_age) {
  std::shared_ptr<const SourceSnapshot> snapshot;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!is_current(shared_.get(), model)) return nullptr;
    snapshot = shared_;
  }
  if (!is_map_) return snapshot;
  const auto placed = std::make_shared<SourceSnapshot>(*snapshot);
  return place_map(time, max_age, placed.get()).empty() ? placed : nullptr;
}

/// With mutex_ held.
bool CloudSource::is_current(const SourceSnapshot* snapshot,
                             const std::shared_ptr<const RobotModel>& model) {
  notice_clock_jump();
  return snapshot && model && snapshot->model == model &&
         (snapshot->generation == shared_target_.generation ||
          (snapshot->generation != 0 && is_for_ever()));
}

/// The snapshot to fill next: an old one, unless somebody still holds that.
std::shared_ptr<SourceSnapshot>& CloudSource::writable() {
  std::shared_ptr<SourceSnapshot>& snapshot = channel_.back();
  if (!snapshot || snapshot.use_count() > 1) snapshot = std::make_shared<SourceSnapshot>();
  // use_count() alone does not order what the last holder read before what is written now.
  std::atomic_thread_fence(std::memory_order_acquire);
  return snapshot;
}

std::string CloudSource::place_map(const ros::Time& time, double max_age,
                                   SourceSnapshot* snapshot) const {
  const std::string &fixed = snapshot->fixed_frame, &frame = snapshot->map_frame;
  Eigen::Isometry3d& X_FM = snapshot->cloud.X_FM;
  std::string ignored;
  // Asked first: an exception in every cycle would cost more than the answer.
  if (is_known(buffer_, fixed, frame, time, &ignored)) {
    return look_up(buffer_, fixed, frame, time, &X_FM);
  }
  return look_up_newest(buffer_, fixed, frame, time, max_age, &X_FM);
}

SourceFacts CloudSource::facts() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  SourceFacts facts = facts_;
  if (!placing_problem_.empty()) facts.problem = placing_problem_;
  if (!file_problem_.empty()) facts.problem = file_problem_;
  return facts;
}

bool CloudSource::is_for_ever() const {
  return is_map_ && (!config_.file.empty() || std::isinf(config_.timeout));
}

void CloudSource::notice_clock_jump() {
  const ros::Time now = ros::Time::now();
  if (now < last_now_) {
    ++shared_target_.generation;
    if (!is_for_ever()) {
      facts_.messages = 0;
      facts_.newest = std::numeric_limits<double>::quiet_NaN();
      facts_.problem.clear();
    }
  }
  last_now_ = now;
}

CloudSource::Target CloudSource::target() {
  const std::lock_guard<std::mutex> lock(mutex_);
  notice_clock_jump();
  return shared_target_;
}

void CloudSource::set_problem(const std::string& problem, bool dropped) {
  const std::lock_guard<std::mutex> lock(mutex_);
  facts_.problem = problem;
  if (dropped) ++facts_.unusable;
}

void CloudSource::run() {
  name_thread("ist " + config_.name);
  if (!config_.file.empty()) {
    const Received received = read_map_file(config_.file, without_slash(config_.frame_id));
    const std::lock_guard<std::mutex> lock(mutex_);
    file_problem_ = received.fault;
    kept_ = received.measurement;
    kept_is_new_ = kept_ != nullptr;
  }
  while (running_) {
    queue_.callAvailable(waiting_.empty() ? kPollIdle : kPollTf);
    forget_old();
    use_newest_ready();
    use_kept();
    count_publishers();
  }
}

void CloudSource::count_publishers() {
  const std::optional<std::uint32_t> publishers = publisher_count_.ask(subscriber_);
  if (!publishers) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  facts_.publishers = *publishers;
}

/// Drops what belongs to another model or to the time before the clock's jump, and what has waited
/// until nobody may use it any more.
void CloudSource::forget_old() {
  Target now_asked = target();
  if (now_asked.generation != target_.generation) {
    waiting_.clear();
    if (!is_for_ever()) kept_.reset();
  }
  if (now_asked.generation != target_.generation || now_asked.model != target_.model) {
    in_use_ = ros::Time();
    kept_is_new_ = kept_ != nullptr;
    target_since_ = std::chrono::steady_clock::now();
  }
  target_ = std::move(now_asked);
  if (!target_.model) waiting_.clear();

  const double now = ros::Time::now().toSec();
  while (!waiting_.empty() && (waiting_.size() > kMaxWaiting ||
                               now - waiting_.front()->header().stamp.toSec() > config_.timeout)) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++facts_.unusable;
    waiting_.pop_front();
  }
}

void CloudSource::receive(const Received& received) {
  forget_old();
  const ros::Time& stamp = received.header.stamp;
  const std::string problem = why_unusable(received);
  const double ahead = seconds_between(ros::Time::now(), stamp);
  const bool believed = !stamp.isZero() && ahead <= future_tolerance(config_.timeout);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++facts_.messages;
    if (believed) facts_.newest = std::fmax(facts_.newest, stamp.toSec());
    if (believed && stamp < in_use_) {
      ++facts_.out_of_order;
      return;
    }
    // That others wait for tf passes when one is in use, or is none of the reasons any more.
    if (!waits_for_tf_ || ahead < -config_.timeout) facts_.problem.clear();
    if (!problem.empty()) {
      facts_.problem = problem;
      waits_for_tf_ = false;
      ++facts_.unusable;
      return;
    }
  }
  if (is_map_) {
    kept_ = received.measurement;
    kept_is_new_ = true;
    return;
  }
  const auto after = std::upper_bound(
      waiting_.begin(), waiting_.end(), stamp,
      [](const ros::Time& time, const Waiting& other) { return time < other->header().stamp; });
  waiting_.insert(after, received.measurement);
}

std::string CloudSource::why_unusable(const Received& received) const {
  const ros::Time& stamp = received.header.stamp;
  const std::string plural = "its " + facts_.noun + "s ";
  if (stamp.isZero()) return plural + "have no stamp (0): the driver must set header.stamp";
  const double ahead = seconds_between(ros::Time::now(), stamp);
  if (ahead > future_tolerance(config_.timeout)) {
    char text[96];
    std::snprintf(text, sizeof text, "are stamped %.2f s in the future: ", ahead);
    return plural + text + "compare the clocks of sensor and node";
  }
  if (received.header.frame_id.empty()) return plural + "have an empty frame_id";
  if (!received.fault.empty()) return received.fault;
  if (!target_.model && !is_map_) return "it waits for the robot's model";
  return "";
}

/// That the newest one waits for tf a while is no problem yet.
void CloudSource::use_newest_ready() {
  const auto now = std::chrono::steady_clock::now();
  if (waiting_.empty()) waits_since_ = now;
  const std::chrono::duration<double> waits = now - waits_since_;
  const bool is_usual = waits.count() < 0.5 * std::min(config_.timeout, 1.0);
  for (std::size_t i = waiting_.size(); i-- > 0;) {
    std::string problem = missing_transform(*waiting_[i]);
    if (!problem.empty()) {
      if (i + 1 == waiting_.size() && !is_usual) {
        set_problem(problem, false);
        waits_for_tf_ = true;
      }
      continue;
    }
    waits_since_ = now;
    problem = ingest(*waiting_[i]);
    waits_for_tf_ = false;
    set_problem(problem, !problem.empty());
    const std::lock_guard<std::mutex> lock(mutex_);
    facts_.overtaken += i;
    waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(i) + 1);
    return;
  }
}

void CloudSource::use_kept() {
  if (!kept_ || !kept_is_new_ || !target_.model) return;
  kept_is_new_ = false;
  const std::string problem = ingest(*kept_);
  set_problem(problem, !problem.empty());
}

/// Empty when all that is needed at the measurement's instants is known.
std::string CloudSource::missing_transform(const Measurement& waiting) const {
  const std::string sensor = without_slash(waiting.header().frame_id);
  const std::vector<ros::Time> instants = waiting.instants();
  std::string problem;
  for (const ros::Time& time : {instants.front(), instants.back()}) {
    if (!is_known(buffer_, target_.fixed_frame, sensor, time, &problem)) return problem;
  }
  if (!config_.ingest.self_filter) return "";
  for (const ros::Time& time : {instants.front(), instants.back()}) {
    for (const LinkModel& link : target_.model->links) {
      if (link.usable() && !is_known(buffer_, target_.fixed_frame, link.name, time, &problem) &&
          worth_waiting_for(link.name, time)) {
        return "the self-filter waits: " + problem;
      }
    }
  }
  return "";
}

/// A cloud is worth more without one link's self-filter than past its timeout, so the wait ends
/// before that; and it does not begin for a link that stands still in tf. At the start all links
/// are given time to appear.
bool CloudSource::worth_waiting_for(const std::string& link, const ros::Time& stamp) const {
  const ros::Time now = ros::Time::now();
  const double patience = 0.8 * std::min(config_.timeout, 1.0);  // [s]
  if (seconds_between(stamp, now) > patience) return false;
  if (std::chrono::steady_clock::now() - target_since_ < kGrace) return true;
  Eigen::Isometry3d ignored;
  ros::Time newest;
  return look_up(buffer_, target_.fixed_frame, link, ros::Time(), &ignored, &newest).empty() &&
         seconds_between(newest, now) < patience;
}

void CloudSource::pose_robot(const ros::Time& stamp, Placement* placement) const {
  const auto& links = target_.model->links;
  std::vector<Eigen::Isometry3d> X_FL(links.size(), Eigen::Isometry3d::Identity());
  std::vector<bool> known(links.size(), false);
  std::string ignored;
  for (std::size_t i = 0; i < links.size(); ++i) {
    // Asked first: an exception per missing link and cloud would cost more than the answer.
    known[i] = links[i].usable() &&
               is_known(buffer_, target_.fixed_frame, links[i].name, stamp, &ignored) &&
               look_up(buffer_, target_.fixed_frame, links[i].name, stamp, &X_FL[i]).empty();
    // A link that was missing at any instant is not filtered.
    placement->known[i] = placement->known[i] && known[i];
  }
  append_posed_solids(*target_.model, X_FL, known, &placement->robot);
}

std::string CloudSource::place(const Measurement& waiting, Placement* placement) const {
  const std::string sensor = without_slash(waiting.header().frame_id);
  const std::vector<ros::Time> instants = waiting.instants();
  if (instants.empty()) return "";
  std::string problem =
      look_up(buffer_, target_.fixed_frame, sensor, instants.front(), &placement->X_FS);
  placement->X_FS_end = placement->X_FS;
  if (problem.empty() && instants.size() > 1) {
    problem = look_up(buffer_, target_.fixed_frame, sensor, instants.back(), &placement->X_FS_end);
  }
  if (!problem.empty() || !config_.ingest.self_filter) return problem;
  placement->known.assign(target_.model->links.size(), true);
  for (const ros::Time& instant : instants) pose_robot(instant, placement);
  return "";
}

std::string CloudSource::ingest(const Measurement& waiting) {
  const ros::Time& stamp = waiting.header().stamp;
  Placement placement;
  std::string problem = place(waiting, &placement);
  if (!problem.empty()) return problem;
  const std::shared_ptr<SourceSnapshot>& shared = writable();
  SourceSnapshot& snapshot = *shared;
  // Who looks at the cloud wants to see it whole.
  const bool show = !is_map_ && filtered_.getNumSubscribers() > 0;
  ingest_.set_region_of_interest(show ? RegionOfInterest() : target_.region);
  try {
    waiting.ingest(placement, &ingest_, &snapshot.cloud);
  } catch (const std::exception& error) {  // no memory for a monstrous cloud
    snapshot.generation = 0;
    return "the " + facts_.noun + " could not be read: " + error.what();
  }
  snapshot.stamp = stamp;
  snapshot.model = target_.model;
  snapshot.fixed_frame = target_.fixed_frame;
  snapshot.map_frame = without_slash(waiting.header().frame_id);
  snapshot.filtered = placement.known;
  snapshot.generation = target_.generation;
  in_use_ = stamp;
  if (show) filtered_.publish(to_message(snapshot.cloud, snapshot.stamp, target_.fixed_frame));
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    facts_.shown += show;
    shared_ = shared;
  }
  channel_.publish();
  return "";
}

}  // namespace ist
