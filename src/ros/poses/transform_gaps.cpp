#include "ros/poses/transform_gaps.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "ros/common/eigen_conversion.h"
#include "ros/common/ros_time.h"

namespace ist {
namespace {

// A frame that is within this of its place before has stood still.
constexpr double kStill = 1e-3;  // [m, rad]

// Two poses in different parents are not compared.
bool has_moved(const geometry_msgs::TransformStamped& from,
               const geometry_msgs::TransformStamped& to) {
  Eigen::Isometry3d X_from, X_to;
  if (from.header.frame_id != to.header.frame_id) return true;
  if (!to_isometry(from.transform, &X_from).empty() || !to_isometry(to.transform, &X_to).empty()) {
    return true;
  }
  const Eigen::Isometry3d X = X_from.inverse() * X_to;
  return X.translation().norm() > kStill || Eigen::AngleAxisd(X.linear()).angle() > kStill;
}

}  // namespace

void TransformGaps::note(const geometry_msgs::TransformStamped& transform, double longest,
                         double kept) {
  const ros::Time& stamp = transform.header.stamp;
  if (stamp > newest_.header.stamp) {
    const auto is_old = [&](const ros::Time& end) { return seconds_between(end, stamp) > kept; };
    pauses_.erase(
        std::remove_if(pauses_.begin(), pauses_.end(),
                       [&](const Pause& pause) { return is_old(pause.after.header.stamp); }),
        pauses_.end());
    if (!newest_.header.stamp.isZero()) add_if_long({newest_, transform}, longest);
    newest_ = transform;
  } else {
    const auto divided = std::find_if(pauses_.begin(), pauses_.end(), [&](const Pause& pause) {
      return pause.before.header.stamp < stamp && stamp < pause.after.header.stamp;
    });
    if (divided == pauses_.end()) return;
    const Pause whole = *divided;
    pauses_.erase(divided);
    add_if_long({whole.before, transform}, longest);
    add_if_long({transform, whole.after}, longest);
  }
  gaps_.clear();
  for (const Pause& pause : pauses_) {
    if (!has_moved(pause.before, pause.after)) continue;
    gaps_.push_back({pause.before.header.stamp, pause.after.header.stamp});
  }
}

void TransformGaps::add_if_long(const Pause& pause, double longest) {
  if (seconds_between(pause.before.header.stamp, pause.after.header.stamp) > longest) {
    pauses_.push_back(pause);
  }
}

const TransformGaps::Gap* TransformGaps::find(const ros::Time& instant) const {
  const auto found = std::find_if(gaps_.begin(), gaps_.end(), [&](const Gap& gap) {
    return gap.begin < instant && instant < gap.end;
  });
  return found == gaps_.end() ? nullptr : &*found;
}

}  // namespace ist
