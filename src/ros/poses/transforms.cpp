#include "ros/poses/transforms.h"

#include <cmath>
#include <cstdio>
#include <exception>

#include "ist_proximity/proximity/proximity_query.h"
#include "ros/ros_time.h"

namespace ist {
namespace {

// tf2 knows frames without the slash that older URDFs put in front of links.
bool has_slash(const std::string& frame) { return !frame.empty() && frame[0] == '/'; }

}  // namespace

std::string trimmed(std::string tf_error) {
  while (!tf_error.empty() && (tf_error.back() == ' ' || tf_error.back() == '.')) {
    tf_error.pop_back();
  }
  return tf_error;
}

std::string look_up(const tf2::BufferCore& buffer, const std::string& fixed,
                    const std::string& frame, const ros::Time& time, Eigen::Isometry3d* X_FT,
                    ros::Time* stamp) {
  if (has_slash(fixed) || has_slash(frame)) {
    return look_up(buffer, without_slash(fixed), without_slash(frame), time, X_FT, stamp);
  }
  if (frame == fixed) {  // tf2 would give the stamp of what moves the fixed frame itself
    X_FT->setIdentity();
    if (stamp) *stamp = ros::Time();
    return "";
  }
  geometry_msgs::TransformStamped transform;
  try {
    transform = buffer.lookupTransform(fixed, frame, time);
  } catch (const std::exception& error) {  // tf2's own, or a duration that overflows
    return "no transform from '" + frame + "' to '" + fixed + "': " + trimmed(error.what());
  }
  const std::string fault = to_isometry(transform.transform, X_FT);
  if (!fault.empty()) return "transform from '" + frame + "' to '" + fixed + "': " + fault;
  if (stamp) *stamp = transform.header.stamp;
  return "";
}

std::string look_up_newest(const tf2::BufferCore& buffer, const std::string& fixed,
                           const std::string& frame, const ros::Time& now, double max_age,
                           Eigen::Isometry3d* X_FT) {
  std::string problem;
  // Asked first: an exception in every cycle would cost more than the answer.
  if (!is_known(buffer, fixed, frame, ros::Time(), &problem)) return problem;
  ros::Time stamp;
  Eigen::Isometry3d X;
  problem = look_up(buffer, fixed, frame, ros::Time(), &X, &stamp);
  if (!problem.empty()) return problem;
  const double age = stamp.isZero() ? 0.0 : seconds_between(stamp, now);
  if (age > max_age) {
    char text[96];
    std::snprintf(text, sizeof text, "' is %.2f s old, allowed is %.2f s (~pose_timeout)", age,
                  max_age);
    return "the newest transform from '" + frame + "' to '" + fixed + text;
  }
  *X_FT = X;
  return "";
}

bool is_known(const tf2::BufferCore& buffer, const std::string& fixed, const std::string& frame,
              const ros::Time& time, std::string* problem) {
  if (has_slash(fixed) || has_slash(frame)) {
    return is_known(buffer, without_slash(fixed), without_slash(frame), time, problem);
  }
  if (frame == fixed) return true;
  std::string error;
  try {
    if (buffer.canTransform(fixed, frame, time, &error)) return true;
  } catch (const std::exception& exception) {
    error = exception.what();
  }
  *problem = "no transform from '" + frame + "' to '" + fixed + "': " + trimmed(error);
  return false;
}

std::string to_isometry(const geometry_msgs::Transform& transform, Eigen::Isometry3d* X) {
  const auto& r = transform.rotation;
  Eigen::Quaterniond q(r.w, r.x, r.y, r.z);
  const double norm = q.norm();
  if (!(std::abs(norm - 1.0) < 1e-3)) {
    return "its quaternion has length " + std::to_string(norm) + ", so it is no rotation";
  }
  q.coeffs() /= norm;
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.linear() = q.toRotationMatrix();
  result.translation() << transform.translation.x, transform.translation.y, transform.translation.z;
  if (!is_rigid(result)) return "it holds NaN or infinity";
  *X = result;
  return "";
}

std::string without_slash(const std::string& frame) {
  return has_slash(frame) ? frame.substr(1) : frame;
}

}  // namespace ist
