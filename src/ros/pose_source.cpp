#include "ist_proximity/ros/pose_source.h"

#include <algorithm>
#include <cstdio>

#include "ist_proximity/ros/ros_time.h"
#include "ist_proximity/ros/transforms.h"

namespace ist {

std::size_t LinkPoses::count_known() const {
  return static_cast<std::size_t>(std::count(known.begin(), known.end(), true));
}

PoseSource::PoseSource(const tf2::BufferCore& buffer, std::string fixed_frame,
                       std::vector<std::string> link_frames, std::vector<bool> wanted,
                       double timeout)
    : buffer_(buffer),
      fixed_frame_(std::move(fixed_frame)),
      frames_(std::move(link_frames)),
      wanted_(std::move(wanted)),
      timeout_(timeout) {}

bool PoseSource::newest(std::size_t link, const ros::Time& now, ros::Time* stamp,
                        std::string* problem) {
  Eigen::Isometry3d ignored;
  *problem = ist::look_up(buffer_, fixed_frame_, frames_[link], ros::Time(), &ignored, stamp);
  if (!problem->empty()) return false;
  if (stamp->isZero()) return true;
  const double age = seconds_between(*stamp, now);
  if (age <= timeout_) return true;
  char text[96];
  std::snprintf(text, sizeof text, "' is %.2f s old, allowed is %.2f s (~pose_timeout)", age,
                timeout_);
  *problem = "the newest transform from '" + frames_[link] + "' to '" + fixed_frame_ + text;
  return false;
}

void PoseSource::look_up(const ros::Time& now, LinkPoses* poses) {
  const std::size_t n = frames_.size();
  poses->stamp = now;
  poses->X_FL.resize(n, Eigen::Isometry3d::Identity());
  poses->known.assign(n, false);
  poses->problems.assign(n, std::string());
  if (now.isZero()) {
    for (std::size_t i = 0; i < n; ++i) {
      if (wanted_[i]) poses->problems[i] = "the ROS clock has not started";
    }
    return;
  }

  // Not later than now: a transform stamped ahead of the clock must not push the instant there.
  for (std::size_t i = 0; i < n; ++i) {
    if (!wanted_[i]) continue;
    ros::Time stamp;
    poses->known[i] = newest(i, now, &stamp, &poses->problems[i]);
    if (poses->known[i] && !stamp.isZero()) poses->stamp = std::min(poses->stamp, stamp);
  }
  for (std::size_t i = 0; i < n; ++i) {
    if (!poses->known[i]) continue;
    poses->problems[i] =
        ist::look_up(buffer_, fixed_frame_, frames_[i], poses->stamp, &poses->X_FL[i]);
    poses->known[i] = poses->problems[i].empty();
  }
}

}  // namespace ist
