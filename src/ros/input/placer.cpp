#include "ros/input/placer.h"

#include <algorithm>
#include <vector>

#include "ist_proximity/robot/link_poses.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

constexpr std::chrono::milliseconds kGrace(500);

// Poses of a link that are nearer to each other count once in the self-filter, whose padding is
// much more: a scan of ten seconds has 400 instants, and the robot often stands still. [m]
constexpr double kSamePlace = 0.001;

/// Whether no point of a link moves farther than kSamePlace between two poses.
bool stays_in_place(const InnerSphereTree& tree, const Eigen::Isometry3d& X_FL,
                    const Eigen::Isometry3d& X_FM) {
  const double turned = (X_FL.linear() - X_FM.linear()).norm();  // at least the spectral norm
  return (X_FL * tree.center() - X_FM * tree.center()).norm() + tree.radius() * turned <=
         kSamePlace;
}

}  // namespace

// A cloud is worth more without one link's self-filter than after its timeout, so the wait ends
// before that.
Placer::Placer(const SourceConfig& config, const TransformBuffer& buffer)
    : config_(config), patience_(0.8 * std::min(config.timeout, 1.0)), buffer_(buffer) {}

void Placer::begin_target() { target_since_ = std::chrono::steady_clock::now(); }

std::string Placer::missing_transform(const Measurement& measurement,
                                      const SourceTarget& target) const {
  const std::string sensor = without_slash(measurement.header.frame_id);
  const std::vector<ros::Time>& instants = measurement.instants;
  std::string problem;
  for (const ros::Time& time : {instants.front(), instants.back()}) {
    if (is_known(buffer_, target.fixed_frame, sensor, time, &problem)) continue;
    return with_cause(buffer_, target.fixed_frame, sensor, problem);
  }
  if (!config_.ingest.self_filter) return "";
  for (const ros::Time& time : {instants.front(), instants.back()}) {
    for (std::size_t i = 0; i < target.model->links.size(); ++i) {
      const LinkModel& link = target.model->links[i];
      if (link.usable() && target.filters[i] &&
          !is_known(buffer_, target.fixed_frame, link.name, time, &problem) &&
          is_worth_waiting_for(link.name, target.fixed_frame, time)) {
        return "the self-filter waits: " + problem;
      }
    }
  }
  return "";
}

/// The wait does not even begin for a link whose transforms have stopped. At the start all links
/// get time to appear.
bool Placer::is_worth_waiting_for(const std::string& link, const std::string& fixed_frame,
                                  const ros::Time& stamp) const {
  const ros::Time now = ros::Time::now();
  if (seconds_between(stamp, now) > patience_) return false;
  if (std::chrono::steady_clock::now() - target_since_ < kGrace) return true;
  Eigen::Isometry3d ignored;
  ros::Time newest;
  return look_up(buffer_, fixed_frame, link, ros::Time(), &ignored, &newest).empty() &&
         seconds_between(newest, now) < patience_;
}

/// Adds the links whose poses are known at an instant, but for those that have not moved.
void Placer::pose_robot(const SourceTarget& target, const ros::Time& stamp, std::size_t instant,
                        FilterPoses* last, Placement* placement) const {
  const auto& links = target.model->links;
  std::string ignored;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (!target.filters[i]) continue;
    // An exception per missing link and cloud would cost more than is_known().
    Eigen::Isometry3d X_FL;
    const bool known = links[i].usable() &&
                       is_known(buffer_, target.fixed_frame, links[i].name, stamp, &ignored) &&
                       look_up(buffer_, target.fixed_frame, links[i].name, stamp, &X_FL).empty();
    // A link whose pose is unknown at any instant is not filtered for certain.
    placement->known[i] = placement->known[i] && known;
    if (!known || links[i].tree.empty()) continue;
    if (last->known[i] && stays_in_place(links[i].tree, last->X_FL[i], X_FL)) {
      placement->robot_instants[last->solid[i]].second = instant;  // it is where it was already
      continue;
    }
    last->known[i] = true;
    last->X_FL[i] = X_FL;
    last->solid[i] = placement->robot.size();
    placement->robot.push_back(posed_solid(links[i], X_FL));
    if (const auto& paddings = config_.link_paddings; !paddings.empty()) {
      const auto own = paddings.find(links[i].name);
      placement->paddings.push_back(own == paddings.end() ? config_.other_padding : own->second);
    }
    placement->robot_instants.emplace_back(instant, instant);
  }
}

std::string Placer::place(const Measurement& measurement, const SourceTarget& target,
                          Placement* placement) const {
  const std::string sensor = without_slash(measurement.header.frame_id);
  const std::vector<ros::Time>& instants = measurement.instants;
  if (instants.empty()) return "";
  std::string problem =
      look_up(buffer_, target.fixed_frame, sensor, instants.front(), &placement->X_FS);
  placement->X_FS_end = placement->X_FS;
  if (problem.empty() && instants.size() > 1) {
    problem = look_up(buffer_, target.fixed_frame, sensor, instants.back(), &placement->X_FS_end);
  }
  if (!problem.empty() || !config_.ingest.self_filter) return problem;
  placement->known.assign(target.model->links.size(), true);
  const std::size_t count = target.model->links.size();
  FilterPoses last;
  last.X_FL.assign(count, Eigen::Isometry3d::Identity());
  last.known.assign(count, false);
  last.solid.assign(count, 0);
  for (std::size_t i = 0; i < instants.size(); ++i) {
    pose_robot(target, instants[i], i, &last, placement);
  }
  return "";
}

}  // namespace ist
