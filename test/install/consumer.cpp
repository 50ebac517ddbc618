#include <cstdio>

#include "ist_proximity/geometry/solid.h"

int main() {
  ist::TriangleMesh triangle;
  triangle.vertices = {{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}};
  triangle.triangles = {{0, 1, 2}};
  ist::GeometryElement element;
  element.shape = triangle;
  const ist::Solid solid({element});
  const Eigen::Vector3d nearest = solid.signed_distance({0.2, 0.2, 1.0}).witness;
  std::printf("nearest point: %g %g %g\n", nearest.x(), nearest.y(), nearest.z());
  return (nearest - Eigen::Vector3d(0.2, 0.2, 0.0)).norm() < 1e-12 ? 0 : 1;
}
