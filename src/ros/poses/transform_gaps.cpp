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
  if (stamp <= newest_.header.stamp) {  // it comes late, and divides the gap that it is in
    const Gap* gap = find(stamp);
    if (gap == nullptr) return;
    const Gap parts[] = {{gap->begin, stamp}, {stamp, gap->end}};
    gaps_.erase(gaps_.begin() + (gap - gaps_.data()));
    for (const Gap& part : parts) {
      if (seconds_between(part.begin, part.end) > longest) gaps_.push_back(part);
    }
    return;
  }
  gaps_.erase(
      std::remove_if(gaps_.begin(), gaps_.end(),
                     [&](const Gap& gap) { return seconds_between(gap.end, stamp) > kept; }),
      gaps_.end());
  if (!newest_.header.stamp.isZero() && seconds_between(newest_.header.stamp, stamp) > longest &&
      has_moved(newest_, transform)) {
    gaps_.push_back({newest_.header.stamp, stamp});
  }
  newest_ = transform;
}

const TransformGaps::Gap* TransformGaps::find(const ros::Time& instant) const {
  const auto found = std::find_if(gaps_.begin(), gaps_.end(), [&](const Gap& gap) {
    return gap.begin < instant && instant < gap.end;
  });
  return found == gaps_.end() ? nullptr : &*found;
}

}  // namespace ist
