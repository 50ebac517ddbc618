#include "ros/common/eigen_conversion.h"

#include <cmath>
#include <sstream>

#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

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
  result.translation() = to_vector(transform.translation);
  if (!is_rigid(result)) return "it holds NaN or infinity";
  if (!(result.translation().cwiseAbs().maxCoeff() <= kMaxPosition)) {
    std::ostringstream text;
    const Eigen::Vector3d& p = result.translation();
    text << "it is at (" << p.x() << ", " << p.y() << ", " << p.z() << ") m, allowed are at most "
         << kMaxPosition << " m; choose a frame that is nearer to the robot";
    return text.str();
  }
  *X = result;
  return "";
}

geometry_msgs::Transform to_message(const Eigen::Isometry3d& X) {
  geometry_msgs::Transform message;
  assign(X.translation(), &message.translation);
  const Eigen::Quaterniond q(X.linear());
  message.rotation.x = q.x();
  message.rotation.y = q.y();
  message.rotation.z = q.z();
  message.rotation.w = q.w();
  return message;
}

}  // namespace ist
