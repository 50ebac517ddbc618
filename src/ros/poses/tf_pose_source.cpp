#include "ros/poses/tf_pose_source.h"

#include <algorithm>

#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/poses/transforms.h"

namespace ist {

TfPoseSource::TfPoseSource(const TransformBuffer& buffer, std::string fixed_frame,
                           std::vector<std::string> link_frames, std::vector<bool> wanted,
                           double timeout)
    : buffer_(buffer),
      fixed_frame_(std::move(fixed_frame)),
      frames_(std::move(link_frames)),
      wanted_(std::move(wanted)),
      timeout_(timeout) {}

void TfPoseSource::look_up(const ros::Time& now, StampedLinkPoses* poses) {
  const std::size_t n = frames_.size();
  const ros::Time last = poses->stamp;
  poses->reset(now, n);
  if (now.isZero()) return poses->set_problem(wanted_, {"the ROS clock has not started", true});

  // The instant is never later than now, even if transforms are stamped ahead of the clock.
  ros::Time instant = now;
  std::vector<ros::Time>& stamps = stamps_;
  stamps.assign(n, ros::Time());
  for (std::size_t i = 0; i < n; ++i) {
    if (!wanted_[i]) continue;
    PoseProblem& problem = poses->problems[i];
    problem.text = look_up_newest(buffer_, fixed_frame_, frames_[i], now, timeout_, &poses->X_FL[i],
                                  &stamps[i], &problem.explained);
    poses->known[i] = problem.empty();
    if (poses->known[i] && !stamps[i].isZero()) instant = std::min(instant, stamps[i]);
  }
  poses->stamp = std::max(instant, last);
  for (std::size_t i = 0; i < n; ++i) {
    if (!poses->known[i]) continue;
    PoseProblem& problem = poses->problems[i];
    if (!stamps[i].isZero() && stamps[i] < poses->stamp) {
      problem = {format_text("its newest pose is from %.3f s before the last answer",
                             seconds_between(stamps[i], poses->stamp)),
                 true};
    } else if (stamps[i] > poses->stamp) {  // else its newest pose is that of the instant
      problem.text = ist::look_up(buffer_, fixed_frame_, frames_[i], poses->stamp, &poses->X_FL[i]);
    }
    poses->known[i] = problem.empty();
    if (poses->known[i]) poses->add_doubt(doubt_of_pose(buffer_, fixed_frame_, frames_[i]));
  }
}

void TfPoseSource::look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                               BodyPoses* bodies) {
  const auto& names = kinematics.bodies();
  bodies->X_FB.resize(names.size());
  bodies->known.resize(names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    bodies->known[i] =
        ist::look_up(buffer_, fixed_frame_, names[i], instant, &bodies->X_FB[i]).empty();
  }
}

/// Finds a frame of tf that ends in a link's name, as with a tf_prefix; empty when there is none.
std::string TfPoseSource::find_prefixed_frame() const {
  std::vector<std::string> known;
  buffer_._getFrameStrings(known);
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    if (!wanted_[i] || buffer_._frameExists(without_slash(frames_[i]))) continue;
    const std::string end = "/" + without_slash(frames_[i]);
    for (const std::string& frame : known) {
      const bool fits = frame.size() > end.size() &&
                        frame.compare(frame.size() - end.size(), end.size(), end) == 0;
      if (fits) return frame;
    }
  }
  return "";
}

std::string TfPoseSource::hint() const {
  const std::string other = find_prefixed_frame();
  if (!other.empty()) {
    return "tf has '" + other +
           "': is a tf_prefix set? Frames have to have the names of the URDF's links";
  }
  return "is robot_state_publisher running, with joint states coming in?";
}

}  // namespace ist
