#include "ros/trajectory/watched_trajectory.h"

#include <cmath>
#include <set>

#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using Message = trajectory_msgs::JointTrajectory;

constexpr std::size_t kMaxPoints = 10000;  // an hour of points, or more
constexpr std::size_t kMaxPieces = 10000;  // half a second for an answer, or less
constexpr double kMaxTime = 1e5;           // [s]
constexpr double kMaxNumber = 1e4;         // [rad, m]

// The joints by index, or a sentence.
std::string find_joints(const Message& message, const Kinematics& kinematics,
                        std::vector<std::size_t>* joints) {
  if (message.joint_names.empty()) return "it names no joints";
  std::set<std::string> names;
  for (const std::string& name : message.joint_names) {
    if (!names.insert(name).second) return "it names joint '" + printable(name) + "' twice";
    const auto found = kinematics.find_joint(name);
    if (!found) return "the robot has no joint '" + printable(name) + "'";
    if (kinematics.joints()[*found].type == JointType::kFixed ||
        kinematics.joints()[*found].has_unstated_pose()) {
      return "joint '" + name + "' has no position of its own";
    }
    joints->push_back(*found);
  }
  return "";
}

std::string check_numbers(const Message& message, std::size_t point, const char* what,
                          const std::vector<double>& numbers, bool may_lack) {
  if (numbers.empty() && may_lack) return "";
  if (numbers.size() != message.joint_names.size()) {
    return format_text("points[%zu] has %zu %s for %zu joints", point, numbers.size(), what,
                       message.joint_names.size());
  }
  for (std::size_t j = 0; j < numbers.size(); ++j) {
    if (std::abs(numbers[j]) <= kMaxNumber) continue;  // not NaN
    return format_text("points[%zu]: %g among the %s, of joint '%s'", point, numbers[j], what,
                       message.joint_names[j].c_str());
  }
  return "";
}

std::string check_points(const Message& message) {
  if (message.points.size() > kMaxPoints) {
    return format_text("it has %zu points, more than %zu", message.points.size(), kMaxPoints);
  }
  double before = -1.0;
  for (std::size_t k = 0; k < message.points.size(); ++k) {
    const auto& point = message.points[k];
    std::string fault = check_numbers(message, k, "positions", point.positions, false);
    if (fault.empty()) fault = check_numbers(message, k, "velocities", point.velocities, true);
    if (fault.empty())
      fault = check_numbers(message, k, "accelerations", point.accelerations, true);
    if (!fault.empty()) return fault;
    const auto& first = message.points[0];
    if (point.velocities.empty() != first.velocities.empty() ||
        point.accelerations.empty() != first.accelerations.empty()) {
      return format_text(
          "points[%zu] has velocities or accelerations where points[0] has none, or "
          "the other way round",
          k);
    }
    const double time = point.time_from_start.toSec();
    if (!(time > before) || time < 0.0 || time > kMaxTime) {
      return format_text("the time_from_start of points[%zu], %g s, %s", k, time,
                         time > kMaxTime ? "is more than a day" : "does not rise");
    }
    before = time;
  }
  return "";
}

// Puts the numbers of the message's joints where the kinematics has them.
std::vector<double> by_joint(const std::vector<double>& numbers,
                             const std::vector<std::size_t>& joints, std::size_t count) {
  std::vector<double> row(count, kNaN);
  for (std::size_t j = 0; j < joints.size(); ++j) row[joints[j]] = numbers[j];
  return row;
}

}  // namespace

sensor_msgs::JointState WatchedTrajectory::state(const Kinematics& kinematics, double time) const {
  sensor_msgs::JointState message;
  const std::vector<double> q = positions_at(pieces, time);
  for (const std::size_t joint : joints) {
    message.name.push_back(kinematics.joints()[joint].name);
    message.position.push_back(q[joint]);
  }
  return message;
}

std::string read_trajectory(const Message& message, const Kinematics& kinematics,
                            const PresentMotion& present, const ros::Time& received,
                            WatchedTrajectory* trajectory) {
  std::vector<std::size_t> joints;
  std::string fault = find_joints(message, kinematics, &joints);
  if (fault.empty()) fault = check_points(message);
  if (!fault.empty()) return fault;
  const ros::Time start = message.header.stamp.isZero() ? received : message.header.stamp;
  if (start.toSec() > received.toSec() + kMaxTime) {
    return format_text("it begins in %g s, which is more than a day",
                       start.toSec() - received.toSec());
  }
  const std::size_t count = kinematics.joints().size();
  JointTrajectory path;
  const auto& first = message.points.front();
  if (first.time_from_start.toSec() > 0.0) {
    std::vector<double> q, dq;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const std::string& name = message.joint_names[j];
      const double to = first.positions[j];
      const JointMotionNow now = present(name);
      q.push_back(to + kinematics.joints()[joints[j]].way(to, now.q));
      dq.push_back(std::abs(now.dq) <= kMaxNumber ? now.dq : 0.0);  // not NaN
      if (std::isnan(q.back())) {
        return "its first point is not at time 0, and the position of joint '" + name +
               "' is not known";
      }
    }
    path.times.push_back(0.0);
    path.positions.push_back(by_joint(q, joints, count));
    const std::vector<double> rest(q.size(), 0.0);
    if (!first.velocities.empty()) path.velocities.push_back(by_joint(dq, joints, count));
    if (!first.accelerations.empty()) path.accelerations.push_back(by_joint(rest, joints, count));
  }
  for (const auto& point : message.points) {
    path.times.push_back(point.time_from_start.toSec());
    path.positions.push_back(by_joint(point.positions, joints, count));
    if (!point.velocities.empty()) {
      path.velocities.push_back(by_joint(point.velocities, joints, count));
    }
    if (!point.accelerations.empty()) {
      path.accelerations.push_back(by_joint(point.accelerations, joints, count));
    }
  }
  if (path.velocities.empty()) path.accelerations.clear();
  trajectory->start = start;
  trajectory->joints = std::move(joints);
  trajectory->pieces = straight_pieces(path);
  if (trajectory->pieces.times.size() <= kMaxPieces) return "";
  return format_text("it turns too often: %zu straight pieces are near it, more than %zu",
                     trajectory->pieces.times.size(), kMaxPieces);
}

}  // namespace ist
