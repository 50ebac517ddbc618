#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "ist_proximity/facade/obstacles.h"

namespace ist::test {

/// The points of a PCD file in float32, in file order.
inline std::vector<Eigen::Vector3f> read_pcd(const std::string& path) {
  std::vector<Eigen::Vector3f> points;
  for (const Eigen::Vector3d& p : read_points(path).points) points.push_back(p.cast<float>());
  return points;
}

}  // namespace ist::test
