#include "ros/poses/transforms.h"

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

// [m] The queries compute in float, which resolves a millimetre there.
constexpr double kMaxDistance = 1e4;

// Of the motion of a frame whose pose is late: shorter ones would measure the noise of its pose.
// [s]
constexpr double kLeastWindow = 0.1;

bool has_slash(const std::string& frame) { return !frame.empty() && frame[0] == '/'; }

/// Removes the full stop and the space at the end of tf2's sentences, so that others can follow.
std::string trimmed(std::string tf_error) {
  while (!tf_error.empty() && (tf_error.back() == ' ' || tf_error.back() == '.')) {
    tf_error.pop_back();
  }
  return tf_error;
}

/// Whether tf2 has a pose at an instant, by interpolation where it is between two.
bool can_interpolate(const TransformBuffer& buffer, const std::string& fixed,
                     const std::string& frame, const ros::Time& time, std::string* problem) {
  if (has_slash(fixed) || has_slash(frame)) {
    return can_interpolate(buffer, without_slash(fixed), without_slash(frame), time, problem);
  }
  if (frame == fixed) return true;
  std::string error = buffer.dispute(fixed, frame);
  if (!error.empty()) {
    if (problem) *problem = error;
    return false;
  }
  try {
    if (buffer.canTransform(fixed, frame, time, problem ? &error : nullptr)) return true;
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  if (problem) *problem = "no transform from '" + frame + "' to '" + fixed + "': " + trimmed(error);
  return false;
}

/// Looks up such a pose, also in a gap.
std::string interpolate(const TransformBuffer& buffer, const std::string& fixed,
                        const std::string& frame, const ros::Time& time, Eigen::Isometry3d* X_FT,
                        ros::Time* stamp = nullptr) {
  if (has_slash(fixed) || has_slash(frame)) {
    return interpolate(buffer, without_slash(fixed), without_slash(frame), time, X_FT, stamp);
  }
  if (frame == fixed) {  // tf2 would give the stamp of the fixed frame in its own parent
    X_FT->setIdentity();
    if (stamp) *stamp = ros::Time();
    return "";
  }
  std::string problem;
  // An exception for each frame that tf does not know would cost more than this question.
  if (!can_interpolate(buffer, fixed, frame, time, &problem)) return problem;
  geometry_msgs::TransformStamped transform;
  try {
    transform = buffer.lookupTransform(fixed, frame, time);
  } catch (const std::exception& error) {  // an exception of tf2, or a duration that overflows
    return "no transform from '" + frame + "' to '" + fixed + "': " + trimmed(error.what());
  }
  Eigen::Isometry3d X;
  const std::string fault = to_isometry(transform.transform, &X);
  if (fault.empty() && !(X.translation().norm() <= kMaxDistance)) {
    return "transform from '" + frame + "' to '" + fixed +
           format_text("': it is %.6g m long, allowed is %.6g m", X.translation().norm(),
                       kMaxDistance);
  }
  if (!fault.empty()) return "transform from '" + frame + "' to '" + fixed + "': " + fault;
  *X_FT = X;
  if (stamp) *stamp = transform.header.stamp;
  return "";
}

}  // namespace

std::string look_up(const TransformBuffer& buffer, const std::string& fixed,
                    const std::string& frame, const ros::Time& time, Eigen::Isometry3d* X_FT,
                    ros::Time* stamp) {
  ros::Time found;
  Eigen::Isometry3d X;
  std::string problem = interpolate(buffer, fixed, frame, time, &X, &found);
  if (problem.empty()) problem = buffer.gap(fixed, frame, found);
  if (!problem.empty()) return problem;
  *X_FT = X;
  if (stamp) *stamp = found;
  return "";
}

std::string look_up_newest(const TransformBuffer& buffer, const std::string& fixed,
                           const std::string& frame, const ros::Time& now, double max_age,
                           Eigen::Isometry3d* X_FT, ros::Time* newest, bool* explained) {
  ros::Time stamp;
  Eigen::Isometry3d X;
  std::string problem = look_up(buffer, fixed, frame, ros::Time(), &X, &stamp);
  if (problem.empty() && !stamp.isZero()) {
    const double age = seconds_between(buffer.counts_from(fixed, frame, stamp), now);
    if (age > max_age) problem = too_old(fixed, frame, age, max_age);
  }
  if (!problem.empty()) return with_cause(buffer, fixed, frame, problem, explained);
  *X_FT = X;
  if (newest) *newest = stamp;
  return "";
}

std::string look_up_near(const TransformBuffer& buffer, const std::string& fixed,
                         const std::string& frame, const ros::Time& time, double max_age,
                         Eigen::Isometry3d* X_FT, Lag* lag) {
  lag->frame = frame;
  lag->age = 0.0;
  lag->windows = 0;
  lag->apart.setIdentity();
  if (is_known(buffer, fixed, frame, time, nullptr)) {
    return look_up(buffer, fixed, frame, time, X_FT);
  }
  ros::Time stamp;
  Eigen::Isometry3d X_newest;
  std::string problem = look_up_newest(buffer, fixed, frame, time, max_age, &X_newest, &stamp);
  if (!problem.empty()) return problem;
  if (stamp.isZero()) {
    *X_FT = X_newest;
    return "";
  }
  lag->age = std::abs(seconds_between(stamp, time));
  lag->window = std::max(lag->age, kLeastWindow);
  Eigen::Isometry3d X_after = X_newest;
  while (lag->windows < Lag::kMostWindows && stamp.toSec() > lag->window) {
    Eigen::Isometry3d X;
    stamp -= ros::Duration(lag->window);
    if (!interpolate(buffer, fixed, frame, stamp, &X).empty()) break;
    lag->moved[lag->windows++] = X_after * X.inverse();
    X_after = X;
  }
  if (lag->windows == 0) {
    return "the newest pose of frame '" + frame + "' is " +
           format_text(
               "%.2f s old, and how it moves is not known yet: its poses of %.2f s are "
               "needed",
               lag->age, lag->window);
  }
  *X_FT = X_newest;
  return "";
}

bool is_known(const TransformBuffer& buffer, const std::string& fixed, const std::string& frame,
              const ros::Time& time, std::string* problem) {
  if (!can_interpolate(buffer, fixed, frame, time, problem)) return false;
  std::string gap = buffer.gap(fixed, frame, time);
  if (gap.empty()) return true;
  if (problem) *problem = std::move(gap);
  return false;
}

std::string with_cause(const TransformBuffer& buffer, const std::string& fixed,
                       const std::string& frame, const std::string& problem, bool* explained) {
  const bool is_dispute = !buffer.dispute(fixed, frame).empty();
  const std::string cause = is_dispute ? "" : buffer.why_refused(fixed, frame);
  if (explained) *explained = is_dispute || !cause.empty();
  return cause.empty() ? problem : problem + ": " + cause;
}

std::string doubt_of_pose(const TransformBuffer& buffer, const std::string& fixed,
                          const std::string& frame) {
  const std::string refusal = buffer.why_refused(fixed, frame);
  return refusal.empty() ? refusal : refusal + "; the pose in use is that of other transforms";
}

std::string too_old(const std::string& fixed, const std::string& frame, double age,
                    double max_age) {
  return "the newest transform from '" + frame + "' to '" + fixed +
         format_text("' is %.2f s old, allowed is %.2f s (~pose_timeout)", age, max_age);
}

}  // namespace ist
