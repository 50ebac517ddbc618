#include "obstacle.h"
#include "internal/geometry/solid_queries.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

namespace ist::sim {

Eigen::Isometry3d Obstacle::pose(double time) const {
  Eigen::Isometry3d X_FO = Eigen::Isometry3d::Identity();
  X_FO.linear() = R_FO;
  if (path) {
    X_FO.translation() = path(time);
    return X_FO;
  }
  const Eigen::Vector3d displacement = to - from;
  const double length = displacement.norm();
  double since = time - start;
  bool back = false;
  if (repeat > 0.0 && since > 0.0) {
    const double rounds = std::floor(since / repeat);
    since -= rounds * repeat;
    back = std::fmod(rounds, 2.0) == 1.0;
  }
  double travelled = std::clamp(speed * since, 0.0, length);
  if (back) travelled = length - travelled;
  X_FO.translation() =
      length > 0.0 ? Eigen::Vector3d(from + travelled / length * displacement) : from;
  return X_FO;
}

double Obstacle::radius() const {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  return 0.5 * std::get<Box>(shape).size.norm();
}

double distance(const Solid& solid, const Eigen::Isometry3d& X_FL, const Obstacle& obstacle,
                const Eigen::Isometry3d& X_FO, double max_distance) {
  if (const auto* sphere = std::get_if<Sphere>(&obstacle.shape)) {
    const Eigen::Vector3d c_L = X_FL.inverse() * X_FO.translation();
    const double d = solid.signed_distance(c_L).distance - sphere->radius;
    return d < max_distance ? d : std::numeric_limits<double>::infinity();
  }
  const Eigen::Vector3d half = 0.5 * std::get<Box>(obstacle.shape).size;
  const Eigen::AlignedBox3d box(Eigen::Vector3d(-half), half);
  return distance_to_box(solid, box, X_FO.inverse() * X_FL, max_distance).distance;
}

}  // namespace ist::sim
