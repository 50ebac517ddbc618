#include "ros/input/world_source.h"

#include <ros/console.h>

#include <algorithm>
#include <utility>

#include "ros/common/exceptions.h"
#include "ros/common/publish.h"
#include "ros/input/world_conversion.h"
#include "ros/input/world_markers.h"

namespace ist {
namespace {

using Kind = WorldFaultKind;

const ros::WallDuration kPoll(0.02);
// Messages change the world, so none may be lost.
constexpr std::uint32_t kWorldQueueSize = 1000;

}  // namespace

WorldSource::WorldSource(const SourceConfig& config, ros::NodeHandle nh, ros::NodeHandle private_nh,
                         TransformBuffer* buffer)
    : Source(config, nh, *buffer, ""),
      nh_(nh),
      robot_buffer_(*buffer),
      robot_prefix_(config.world.robot.joint_states.empty() ? config.world.robot.tf_prefix
                                                            : "(robot of " + config.name + ") "),
      builder_(config.world.limits) {
  const OtherRobotConfig& robot = config.world.robot;
  if (!robot.description.empty()) {
    if (!robot.joint_states.empty()) {
      robot_joints_ = std::make_unique<JointStateListener>(buffer, nh, robot.joint_states,
                                                           robot_prefix_, [] {});
    }
    is_robot_read_ = false;
    faults_[fault_of(Kind::kRobot)] = "waiting for the other robot's URDF";
    show_faults();
  }
  markers_ = private_nh.advertise<visualization_msgs::MarkerArray>("world/" + config.name, 1, true);
  nh.setCallbackQueue(&queue_);
  if (config.world.has_topic) {
    subscribers_ = {nh.subscribe(config.topic, kWorldQueueSize, &WorldSource::receive, this,
                                 ros::TransportHints().tcpNoDelay())};
  }
  start();
}

void WorldSource::run() {
  guard(Kind::kConfigured, [this] { read_configured(); });
  is_changed_ = true;
  while (running_) {
    guard(Kind::kMessage, [this] { queue_.callAvailable(kPoll); });
    guard(Kind::kWork, [this] {
      if (!is_robot_read_) read_robot();
      count_publishers();
      if (is_mirror_) note_silence();
      take_target();
      if (is_changed_ && target_.model) publish();
      // So that no query has to free what nobody else has any more.
      made_.erase(std::remove_if(made_.begin(), made_.end(),
                                 [](const auto& world) { return world.use_count() == 1; }),
                  made_.end());
      if (faults_.erase(fault_of(Kind::kWork)) > 0) show_faults();
    });
  }
}

void WorldSource::guard(WorldFaultKind what, const std::function<void()>& function) {
  const std::string fault = exception_of(function);
  if (fault.empty()) return;
  if (faults_.count(fault_of(what)) == 0)
    note_fault(fault_of(what), "its objects could not be used: " + fault);
  show_faults();
}

void WorldSource::note_fault(const WorldFaultKey& key, const std::string& fault) {
  if (fault_log_.is_due(fault, WorldFaultLog::Clock::now())) {
    ROS_ERROR_STREAM("source '" << config_.name << "': " << fault);
  }
  // Names that are never sent again would fill the memory.
  const bool is_named = key.first >= Kind::kClash;
  if (is_named && faults_.size() >= config_.world.limits.max_objects && faults_.count(key) == 0) {
    faults_[fault_of(Kind::kMany)] = "more than " +
                                     std::to_string(config_.world.limits.max_objects) +
                                     " objects could not be used; replace all of them";
    return;
  }
  faults_[key] = fault;
}

/// The source is not OK while an object is missing: at once, and until a snapshot holds it.
void WorldSource::show_faults() {
  std::string text;
  if (!faults_.empty()) {
    text = faults_.begin()->second;
    if (faults_.size() > 1) {
      text += "; and " + std::to_string(faults_.size() - 1) + " more objects cannot be used";
    }
  }
  if (text == incomplete_) return;
  incomplete_ = text;
  is_changed_ = true;
  update([&](SourceReport* report) { report->incomplete = text; });
}

void WorldSource::take_target() {
  SourceTarget newest = newest_target();
  const bool is_same_robot = newest.is_same_robot(target_);
  is_changed_ |= !is_same_robot || newest.fixed_frame != target_.fixed_frame ||
                 newest.generation != target_.generation;
  if (!is_same_robot) {
    surfaces_ = newest.model ? make_robot_surfaces(newest.model, cancelled_) : nullptr;
  }
  target_ = std::move(newest);
}

void WorldSource::publish() {
  SourceSnapshot& snapshot = exchange_.writable();
  snapshot = SourceSnapshot();
  snapshot.world.world = builder_.world();
  made_.push_back(snapshot.world.world);
  snapshot.world.X_FB.assign(snapshot.world.world->frames().size(), Eigen::Isometry3d::Identity());
  snapshot.surfaces = surfaces_;
  snapshot.model = surfaces_ ? target_.model : nullptr;
  snapshot.fixed_frame = target_.fixed_frame;
  snapshot.generation = target_.generation;
  snapshot.stamp = snapshot.counts_from = stamp_;
  snapshot.cloud.boxes = octomap_;
  snapshot.map_frame = octomap_frame_;
  snapshot.X_BM = X_BM_;
  snapshot.cloud.stamp = stamp_.toSec();
  snapshot.cloud.counts.received = snapshot.cloud.counts.used =
      static_cast<std::uint32_t>(builder_.size() + (octomap_ ? octomap_->size() : 0));
  snapshot.incomplete = incomplete_;
  snapshot.has_messages = has_received_ || !config_.world.has_topic;
  exchange_.publish();
  is_changed_ = false;
  publish_markers();
}

void WorldSource::publish_markers() {
  const auto frame_of = [this](const std::string& frame) {
    if (frame == kFixedFrame) return target_.fixed_frame;
    const bool is_ours =
        robot_joints_ && frame.compare(0, robot_prefix_.size(), robot_prefix_) == 0;
    return is_ours ? std::string() : frame;  // tf has no such name
  };
  publish_message(markers_, world_markers(*builder_.world(), frame_of));
}

}  // namespace ist
