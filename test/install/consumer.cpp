#include <cstdio>

#include "ist_proximity/geometry/triangle_bvh.h"

int main() {
  const Eigen::Vector3d nearest = ist::closest_point_on_triangle({0.2, 0.2, 1.0}, {0.0, 0.0, 0.0},
                                                                 {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0});
  std::printf("nearest point: %g %g %g\n", nearest.x(), nearest.y(), nearest.z());
  return (nearest - Eigen::Vector3d(0.2, 0.2, 0.0)).norm() < 1e-12 ? 0 : 1;
}
