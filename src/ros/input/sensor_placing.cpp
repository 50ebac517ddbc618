// This part of SensorSource finds the poses of sensor and robot at the instants of a measurement.
// It takes the place of tf2_ros::MessageFilter, which can neither give up on a single frame
// (setTargetFrames() needs clear(), which races with the tf listener's thread) nor name the
// transform that it waits for.

#include <algorithm>
#include <vector>

#include "ist_proximity/robot/link_poses.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/input/sensor_source.h"
#include "ros/poses/transforms.h"

namespace ist {
namespace {

constexpr std::chrono::milliseconds kGrace(500);
constexpr std::size_t kNowhere = static_cast<std::size_t>(-1);

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

/// @returns empty when all poses are known that are worth waiting for, else a sentence
std::string SensorSource::missing_transform(const Measurement& measurement) const {
  const std::string sensor = without_slash(measurement.header.frame_id);
  const std::vector<ros::Time>& instants = measurement.instants;
  std::string problem;
  for (const ros::Time& time : {instants.front(), instants.back()}) {
    if (is_known(buffer_, target_.fixed_frame, sensor, time, &problem)) continue;
    return with_cause(buffer_, target_.fixed_frame, sensor, problem);
  }
  if (!config_.ingest.self_filter) return "";
  for (const ros::Time& time : {instants.front(), instants.back()}) {
    for (std::size_t i = 0; i < target_.model->links.size(); ++i) {
      const LinkModel& link = target_.model->links[i];
      if (link.usable() && target_.filters[i] &&
          !is_known(buffer_, target_.fixed_frame, link.name, time, &problem) &&
          is_worth_waiting_for(link.name, time)) {
        return "the self-filter waits: " + problem;
      }
    }
  }
  return "";
}

/// The wait does not even begin for a link whose transforms have stopped. At the start all links
/// get time to appear. A cloud is worth more without one link's self-filter than after its timeout,
/// so the wait ends before that.
bool SensorSource::is_worth_waiting_for(const std::string& link, const ros::Time& stamp) const {
  const ros::Time now = ros::Time::now();
  const double patience = 0.8 * std::min(config_.timeout, 1.0);
  if (seconds_between(stamp, now) > patience) return false;
  if (std::chrono::steady_clock::now() - target_since_ < kGrace) return true;
  Eigen::Isometry3d ignored;
  ros::Time newest;
  return look_up(buffer_, target_.fixed_frame, link, ros::Time(), &ignored, &newest).empty() &&
         seconds_between(newest, now) < patience;
}

/// Adds the links whose poses are known at an instant, but for those that have not moved.
/// @param last  by link: the number of its newest solid in Placement::robot; else kNowhere
void SensorSource::pose_robot(const ros::Time& stamp, std::size_t instant,
                              std::vector<std::size_t>* last, Placement* placement) const {
  const auto& links = target_.model->links;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (!target_.filters[i]) continue;
    Eigen::Isometry3d X_FL;
    const bool known = links[i].usable() &&
                       look_up(buffer_, target_.fixed_frame, links[i].name, stamp, &X_FL).empty();
    // A link whose pose is unknown at any instant is not filtered for certain.
    placement->known[i] = placement->known[i] && known;
    if (!known || links[i].tree.empty()) continue;
    std::size_t& solid = (*last)[i];
    if (solid != kNowhere && stays_in_place(links[i].tree, placement->robot[solid].X_FL, X_FL)) {
      placement->robot_instants[solid].second = instant;  // it is where it was already
      continue;
    }
    solid = placement->robot.size();
    placement->robot.push_back(posed_solid(links[i], X_FL));
    if (const auto& paddings = config_.link_paddings; !paddings.empty()) {
      const auto own = paddings.find(links[i].name);
      placement->paddings.push_back(own == paddings.end() ? config_.other_padding : own->second);
    }
    placement->robot_instants.emplace_back(instant, instant);
  }
}

/// Looks up the poses.
/// @returns empty on success, else a sentence
std::string SensorSource::find_poses(const Measurement& measurement, Placement* placement) const {
  const std::string sensor = without_slash(measurement.header.frame_id);
  const std::vector<ros::Time>& instants = measurement.instants;
  if (instants.empty()) return "";
  for (const ros::Time& time : instants) {
    std::string problem = look_up(buffer_, target_.fixed_frame, sensor, time, &placement->X_FS);
    if (!problem.empty()) return problem;
    placement->X_FS_at.push_back(placement->X_FS);
  }
  placement->X_FS = placement->X_FS_at.front();
  if (!config_.ingest.self_filter) return "";
  placement->known.assign(target_.model->links.size(), true);
  std::vector<std::size_t> last(target_.model->links.size(), kNowhere);
  for (std::size_t i = 0; i < instants.size(); ++i) {
    pose_robot(instants[i], i, &last, placement);
  }
  return "";
}

}  // namespace ist
