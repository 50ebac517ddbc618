#include "ros/input/source_memory.h"

#include <ros/console.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "internal/cloud/memory_body.h"
#include "internal/cloud/memory_scan.h"
#include "internal/robot/anytime_model.h"
#include "ros/common/stopwatch.h"

namespace ist {
namespace {

constexpr std::chrono::milliseconds kPublicationPeriod(500), kCountPeriod(200);
// [s] Between two looks at where the robot is; it is a few centimetres farther then.
constexpr double kBodyPeriod = 0.1;
constexpr std::chrono::milliseconds kGrowthPeriod(100);
// [s] A clock that is set back by more has begun anew with its world: a bag, a simulation. Stamps
// of a sender are taken likewise.
constexpr double kShortStep = 1.0;

MemoryConfig map_config(const SourceConfig& config) {
  MemoryConfig map = config.memory.map;
  map.max_range = std::min(map.max_range, config.ingest.max_range);
  return map;
}

// [m] Of points that were put into voxels: the radius of the farthest one.
double extent_of_voxels(const PointExtent& extent, double max_range) {
  return extent.is_zero()
             ? 0.0
             : std::min(extent.radius(std::min(max_range, extent.max_range)), kMaxExtent);
}

bool is_there(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

}  // namespace

SourceMemory::SourceMemory(const SourceConfig& config, bool wants_body,
                           const TransformBuffer& buffer, const ros::Publisher& publisher)
    : config_(config),
      buffer_(buffer),
      wants_body_(wants_body),
      publisher_(publisher),
      map_(map_config(config)),
      body_(map_config(config)) {}

std::shared_ptr<const SourceSnapshot> SourceMemory::take(const Measurement& measurement,
                                                         const Placement& placement,
                                                         const SourceTarget& target,
                                                         const SourceSnapshot& cloud) {
  Stopwatch watch;
  begin_target(target);
  const std::lock_guard<std::mutex> lock(mutex_);
  note_calibration(cloud);
  cloud_stamp_ = cloud.stamp;
  counts_from_ = cloud.counts_from;
  note_extent(extent_of_voxels(cloud.cloud.extent, map_.config().max_range), cloud.cloud.stamp);
  told_next_.problem = insert(measurement, placement, target, cloud);
  std::shared_ptr<const SourceSnapshot> hidden;
  if (told_next_.problem.empty()) {
    hidden = make_snapshot(&MemoryMap::hidden_boxes);
  } else if (!std::isnan(map_.now())) {
    // Space that the last remembered cloud answered for may be out of this one's view.
    map_.forget(cloud.cloud.stamp);
    hidden = make_snapshot(&MemoryMap::occupied_boxes);
  }
  if (map_.lost() > lost_) {
    lost_ = map_.lost();
    note_loss("its memory is full, and " + std::to_string(lost_) +
              " voxels of obstacles are lost so far" + advice());
  }
  publish_when_due(cloud.stamp);
  const auto now = std::chrono::steady_clock::now();
  if (now >= next_count_) {
    next_count_ = now + kCountPeriod;
    told_next_.counts = map_.counts();
  }
  took_ = watch.lap();
  hand_over();
  return hidden;
}

void SourceMemory::begin_target(const SourceTarget& target) {
  if (target.model != robot_) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (robot_ && target.model && !same_geometry(*robot_, *target.model)) forget_body();
    robot_ = target.model;
  }
  if (target.generation == generation_ && target.fixed_frame == fixed_frame_) return;
  // The file is read when the clock begins: what it holds counts as measured then.
  if (generation_ == 0 && ros::Time::now().isZero()) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  const std::string frame_before = fixed_frame_;
  const bool is_first = generation_ == 0;
  const double step = target.set_back - set_back_;
  generation_ = target.generation;
  set_back_ = target.set_back;
  fixed_frame_ = target.fixed_frame;
  if (is_first) {
    read_file();
  } else {
    set_back(step);
    if (fixed_frame_ != frame_before) change_frame(frame_before);
  }
  hand_over();
}

void SourceMemory::change_frame(const std::string& before) {
  lose_all("it was in the frame '" + before + "', and is in '" + fixed_frame_ + "' now");
  forget_body();
  read_file();
}

void SourceMemory::lose_all(const std::string& reason) {
  if (map_.has_obstacles()) note_loss("its memory is lost: " + reason);
  map_.clear();
  region_since_ = kNever;
}

/// A sensor that is calibrated anew has shown its obstacles in other places.
void SourceMemory::note_calibration(const SourceSnapshot& cloud) {
  const bool is_other =
      cloud.map_frame == sensor_frame_ &&
      buffer_.has_static_change(cloud.fixed_frame, cloud.map_frame, static_changes_);
  sensor_frame_ = cloud.map_frame;
  static_changes_ = cloud.static_changes;
  if (is_other) lose_all("a static transform to '" + sensor_frame_ + "' is another one now");
}

/// Obstacles stay where they were seen, and get no older by it. Where so much time is missing that
/// everything may have begun anew, what was free may not be free any more.
void SourceMemory::set_back(double step) {
  if (!(step > 0.0)) return;
  map_.shift_times(-step);
  body_.shift_times(-step);
  stamp_ -= step;
  told_next_.lost_until -= step;
  body_noted_ -= step;
  region_since_ -= step;
  if (step > kShortStep) {
    map_.clear_free();
    forget_body();
  }
  const ros::Duration back(std::min(step, std::min(cloud_stamp_.toSec(), counts_from_.toSec())));
  cloud_stamp_ -= back;
  counts_from_ -= back;
}

void SourceMemory::read_file() {
  const std::string& file = config_.memory.file;
  file_problem_.clear();
  is_file_read_ = true;
  if (file.empty() || !is_there(file)) return;  // it is written later
  file_problem_ = map_.read_file(file, ros::Time::now().toSec());
  if (!file_problem_.empty()) {
    ROS_WARN_STREAM("source '" << config_.name << "': the memory begins empty: " << file_problem_);
  }
}

void SourceMemory::grow_older() {
  if (config_.required || std::chrono::steady_clock::now() < next_growth_) return;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (std::isnan(map_.now())) return;
  map_.forget(ros::Time::now().toSec());
  hand_over();
}

/// Tells that obstacles are lost, for as long as they would have been remembered.
void SourceMemory::note_loss(const std::string& text) {
  told_next_.loss = text;
  told_next_.lost_until = ros::Time::now().toSec() + map_.config().decay;
}

std::string SourceMemory::loss() const {
  const std::shared_ptr<const Told> told = told_.share();
  return told && ros::Time::now().toSec() < told->lost_until ? told->loss : "";
}

/// Hands what is told, and newest(), to those who must not wait for a cloud.
void SourceMemory::hand_over() {
  next_growth_ = std::chrono::steady_clock::now() + kGrowthPeriod;
  told_next_.doubt = file_problem_.empty() ? shortage() : file_problem_;
  if (!config_.required && !std::isnan(map_.now())) {
    told_next_.all = make_snapshot(&MemoryMap::occupied_boxes);
  }
  told_.back() = std::make_shared<const Told>(told_next_);
  told_.publish();
}

const SourceSnapshot* SourceMemory::newest(const SnapshotRequest& /*request*/) {
  const std::shared_ptr<const Told>& told = told_.newest();
  return told ? told->all.get() : nullptr;
}

std::shared_ptr<const SourceSnapshot> SourceMemory::share(const SnapshotRequest& /*request*/) {
  const std::shared_ptr<const Told> told = told_.share();
  return told ? told->all : nullptr;
}

/// @returns empty on success, else why the cloud is not remembered
std::string SourceMemory::insert(const Measurement& measurement, const Placement& placement,
                                 const SourceTarget& target, const SourceSnapshot& cloud) {
  const std::string fault = "the last " + std::string(noun(config_.type)) + " is not remembered: ";
  if (generation_ == 0) return fault + "the ROS clock has not started";
  for (std::size_t i = 0; i < placement.known.size(); ++i) {
    const LinkModel& link = target.model->links[i];
    if (is_pending(link)) {
      return fault + "link '" + link.name + "' is not ready yet, and the robot itself would be";
    }
    if (placement.known[i] || !link.usable() || link.tree.empty()) continue;
    return fault + "the pose of link '" + link.name +
           "' was not known, and the robot itself would be";
  }
  if (!cloud.cloud.counts.saw_enough(kMinMeasured)) {
    return fault + "too little of it was measured";
  }
  note_region(target.region, cloud.cloud.stamp);
  read_memory_scan(measurement.points, cloud.cloud, cloud.cloud.X_FS, config_.ingest.min_range,
                   map_.config().max_range, &scan_, cloud.in_zones);
  map_.insert(scan_);
  stamp_ = cloud.cloud.stamp;
  note_body(placement, cloud.cloud.stamp);
  return "";
}

/// A memory drops what is seen outside of its region, and a larger region does not bring it back.
/// So the larger one holds only from when nothing is left that would have been remembered in it.
void SourceMemory::note_region(const RegionOfInterest& region, double stamp) {
  map_.set_region(region);
  const bool is_first = region_since_ == kNever;
  if (is_first || region.radius != newest_region_.radius ||
      region.center_F != newest_region_.center_F) {
    newest_region_ = region;
    region_since_ = stamp;
  }
  const double before = region_.radius - (region.center_F - region_.center_F).norm();
  const bool is_whole = is_first || stamp - region_since_ > map_.config().decay;
  region_ = {region.center_F, is_whole ? region.radius : std::clamp(before, 0.0, region.radius)};
}

/// A smaller extent counts once all is forgotten that was measured with the larger one.
void SourceMemory::note_extent(double extent, double stamp) {
  const bool is_over = !(std::abs(stamp - extent_since_) <= map_.config().decay);
  if (is_over) extent_ = std::exchange(later_extent_, 0.0);
  if (is_over || extent >= extent_) extent_since_ = stamp;
  later_extent_ = extent >= extent_ ? 0.0 : std::max(later_extent_, extent);
  extent_ = std::max(extent_, extent);
}

void SourceMemory::forget_body() {
  body_.clear();
  links_.clear();
  body_noted_ = 0.0;
}

/// The robot's own space is known: nothing else is there.
void SourceMemory::note_body(const Placement& placement, double stamp) {
  if (!wants_body_ || stamp - body_noted_ < kBodyPeriod) return;
  body_noted_ = stamp;
  links_.clear();
  for (std::size_t i = 0; i < placement.robot.size(); ++i) {
    const double padding =
        placement.paddings.empty() ? config_.ingest.self_filter_padding : placement.paddings[i];
    links_.push_back(ist::note_body({&placement.robot[i], 1}, Eigen::Isometry3d::Identity(),
                                    skin_of(padding), stamp, &body_));
  }
}

/// @param find_boxes  of MemoryMap: the boxes that queries get
std::shared_ptr<const SourceSnapshot> SourceMemory::make_snapshot(
    void (MemoryMap::*find_boxes)(VoxelBoxes*) const) const {
  VoxelBoxes boxes;
  (map_.*find_boxes)(&boxes);
  auto index = std::make_shared<BoxIndex>();
  index->build(boxes);
  auto snapshot = std::make_shared<SourceSnapshot>();
  snapshot->cloud.boxes = index;
  snapshot->cloud.box_extent = extent_;
  snapshot->cloud.region = region_;
  snapshot->cloud.counts.received = static_cast<std::uint32_t>(told_next_.counts.known);
  snapshot->cloud.counts.used = static_cast<std::uint32_t>(boxes.size());
  snapshot->cloud.stamp = cloud_stamp_.toSec();
  snapshot->cloud.ingest_time = took_;
  snapshot->stamp = cloud_stamp_;
  snapshot->counts_from = counts_from_;
  snapshot->generation = generation_;
  return snapshot;
}

void SourceMemory::publish_when_due(const ros::Time& stamp) {
  const auto now = std::chrono::steady_clock::now();
  if (publisher_.getNumSubscribers() == 0 || now < next_publication_) return;
  next_publication_ = now + kPublicationPeriod;
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = fixed_frame_;
  publish_map(publisher_, header, map_.config().resolution, map_.octree_bytes());
}

std::string SourceMemory::shortage() const {
  const MemoryCounts& counts = told_next_.counts;
  if (counts.forgotten == 0 && counts.skipped == 0) return "";
  return "memory is short: " + std::to_string(counts.forgotten) +
         " voxels were forgotten before their time" + advice();
}

std::string SourceMemory::advice() const {
  return "; raise ~memory/max_nodes, which is " + std::to_string(map_.config().max_nodes) +
         ", or lower decay, max_range or the resolution";
}

void SourceMemory::report(SourceReport* report) {
  *report = SourceReport();
  report->name = config_.name + "/memory";
  report->topic = publisher_.getTopic();
  report->type = "octomap_msgs/Octomap";
  report->noun = "memory";
  report->is_memory = true;
  report->measures = false;
  report->required = false;
  const std::shared_ptr<const Told> told = told_.share();
  if (!told) return;
  report->problem = told->problem;
  report->doubt = told->doubt;
  report->memory_voxels = told->counts.nodes;
  report->memory_occupied = told->counts.occupied;
}

std::string SourceMemory::save(bool* is_saved) {
  *is_saved = false;
  const std::string& file = config_.memory.file;
  if (file.empty()) {
    return "source '" + config_.name + "' has no memory/file to write to";
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  // What is in a file that was not read is in nothing else.
  if (is_there(file) && (!is_file_read_ || !file_problem_.empty())) {
    return "'" + file + "' is not overwritten: what it holds has not been read" +
           (is_file_read_ ? " (" + file_problem_ + ")" : ", as no cloud has come yet") +
           "; move it away to save what is known now";
  }
  const std::string fault = map_.write_file(file);
  *is_saved = fault.empty();
  if (*is_saved) file_problem_.clear();
  return fault.empty() ? "source '" + config_.name + "': " + file : fault;
}

bool SourceMemory::add_to(SeenSpace* seen, KnownSpace* known) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (std::isnan(map_.now()) || links_.empty()) return false;
  const double now = ros::Time::now().toSec();
  map_.forget(now);
  body_.forget(now);
  seen->add(map_);
  seen->add(body_);
  known->links = links_;
  known->stamp = stamp_;
  known->frame = fixed_frame_;  // the thread of the source writes both under the same mutex
  known->robot = robot_;
  return true;
}

double SourceMemory::skin() const { return skin_of(config_.ingest.self_filter_padding); }

double SourceMemory::skin_of(double padding) const {
  // A voxel belongs to the skin where any of it may be on the robot.
  constexpr double kHalfDiagonal = 0.87;  // of a voxel
  return padding + kHalfDiagonal * config_.memory.map.resolution;
}

}  // namespace ist
