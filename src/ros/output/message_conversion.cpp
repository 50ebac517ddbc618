#include "ros/output/message_conversion.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/geometry/numbers.h"
#include "ros/common/eigen_conversion.h"
#include "ros/common/ros_time.h"

namespace ist {
namespace {

using LinkMessage = ist_proximity::LinkProximity;
using ist_proximity::ProximityArray;

void assign_closing(const ClosingRates& closing, LinkMessage* message) {
  message->closing_speed = closing.total;
  message->closing_speed_robot = closing.robot;
  message->closing_speed_obstacles = closing.obstacles;
  message->time_to_contact = closing.time_to_contact;
  message->closing_unknown = 0;
  if (std::isnan(closing.robot)) message->closing_unknown |= LinkMessage::ROBOT_UNKNOWN;
  if (std::isnan(closing.obstacles)) message->closing_unknown |= LinkMessage::OBSTACLES_UNKNOWN;
}

// The parts of distance - lower_bound.
void assign_interval(const LinkProximity& result, LinkMessage* message) {
  const bool has = result.state >= LinkState::kNear;
  message->interval_model = has ? result.margin : kNaN;
  message->interval_sensor = has ? result.sensor_width : kNaN;
  message->interval_tolerance =
      has ? std::max(result.distance - result.lower_bound - result.margin - result.sensor_width,
                     0.0)
          : kNaN;
}

}  // namespace

void assign_box(const Eigen::AlignedBox3d& box_L, LinkMessage* message) {
  const Eigen::Vector3d nowhere = Eigen::Vector3d::Constant(kNaN);
  assign(box_L.isEmpty() ? nowhere : Eigen::Vector3d(box_L.center()), &message->box_center);
  assign(box_L.isEmpty() ? nowhere : Eigen::Vector3d(box_L.sizes()), &message->box_size);
}

ist_proximity::LinkPairProximity pair_message(const RobotModel& robot, const LinkPair& pair,
                                              const PairProximity& result) {
  ist_proximity::LinkPairProximity message;
  message.first = robot.links[pair.first].name;
  message.second = robot.links[pair.second].name;
  message.state = static_cast<std::uint8_t>(result.state);
  message.distance = result.distance;
  message.lower_bound = result.lower_bound;
  assign(result.p_FCa, &message.point_on_first);
  assign(result.p_FCb, &message.point_on_second);
  assign(result.direction, &message.direction);
  return message;
}

LinkMessage unknown_link(const std::string& name) {
  LinkMessage message;
  assign_link(name, {}, RepulsiveWrench::unknown(), Wrench::unknown(), {}, "", &message);
  return message;
}

void assign_link(const std::string& name, const LinkProximity& result,
                 const RepulsiveWrench& repulsion, const Wrench& penetration,
                 const ClosingRates& closing, const std::string& source, LinkMessage* message) {
  message->link = name;
  message->state = static_cast<std::uint8_t>(result.state);
  message->distance = result.distance;
  message->lower_bound = result.lower_bound;
  assign_interval(result, message);
  assign(result.p_FCl, &message->point_on_link);
  assign(result.p_LCl, &message->point_on_link_local);
  assign(result.p_FCo, &message->point_on_obstacle);
  assign(result.direction, &message->direction);
  assign(repulsion.force, &message->repulsion);
  assign(repulsion.torque, &message->repulsion_torque);
  assign(penetration.force, &message->penetration.force);
  assign(penetration.torque, &message->penetration.torque);
  assign_closing(closing, message);
  const Eigen::Vector3d nowhere = Eigen::Vector3d::Constant(kNaN);
  assign_unknown_space({}, kNaN, nowhere, false, message);
  assign_box({}, message);
  message->robot_future = kNaN;
  message->source.assign(source, 0, result.state >= LinkState::kNear ? source.size() : 0);
}

void assign_unknown_space(const SeenShare& seen, double lower_bound,
                          const Eigen::Vector3d& direction, bool is_obstacle,
                          LinkMessage* message) {
  message->seen_share = seen.share;
  message->seen_age = seen.age;
  message->unseen_distance = lower_bound;
  assign(direction, &message->unseen_direction);
  if (!is_obstacle || !(lower_bound < message->lower_bound)) return;
  // What no sensor has seen is a part of the sensors' share; NaN stays NaN.
  message->interval_sensor += message->lower_bound - lower_bound;
  message->lower_bound = lower_bound;
}

void assign_source(const SourceReport& source, const ros::Time& stamp,
                   ist_proximity::SourceStatus* message) {
  const bool has = source.has_snapshot;
  const IngestCounts counts = has ? source.counts : IngestCounts();
  message->name = source.name;
  message->status = source.status.code;
  message->stamp = has ? source.stamp : ros::Time();
  message->age = has && !source.is_file ? seconds_between(source.counts_from, stamp) : kNaN;
  message->points_received = counts.received;
  message->points_used = counts.used + counts.outside_region;
  message->measured_share =
      has ? static_cast<float>(counts.measured_share()) : std::numeric_limits<float>::quiet_NaN();
  message->points_on_robot = counts.on_robot;
  message->blind_skin = source.blind_skin;
  if (!has || !source.view.is_used) return;
  message->blind_skin = 0.0;
  for (const LinkView& link : source.view.links) {
    message->blind_skin = std::max(message->blind_skin, link.blind_skin);
  }
}

bool is_incomplete(const ProximityArray& message) {
  return message.status == ProximityArray::NO_CLOUD ||
         message.status == ProximityArray::STALE_CLOUD || message.status == ProximityArray::LOADING;
}

double obstacle_age(const ProximityArray& message, const ros::Time& now) {
  const ros::Time& header = message.header.stamp;
  const ros::Time& oldest = message.cloud_stamp.isZero() ? header : message.cloud_stamp;
  double age = seconds_between(oldest, header);
  for (const ist_proximity::SourceStatus& source : message.sources) {
    // Sources that stand still are not in cloud_stamp, and may be any time older.
    if (source.status == ProximityArray::OK && source.stamp >= oldest) {
      age = std::max(age, source.age);  // NaN of a file, which is left out
    }
  }
  return age + seconds_between(header, now);
}

double min_distance(const ProximityArray& message, const std::vector<bool>& counts) {
  if (is_incomplete(message)) return kNaN;
  bool any = false;
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < message.links.size(); ++i) {
    const LinkMessage& link = message.links[i];
    if (counts.size() == message.links.size() && !counts[i]) continue;
    if (link.state == LinkMessage::UNKNOWN || std::isnan(link.lower_bound)) return kNaN;
    smallest = std::min(smallest, link.lower_bound);
    any = true;
  }
  return any ? smallest : kNaN;
}

}  // namespace ist
