#include <cmath>
#include <cstdio>

#include "ist_proximity/geometry/solid.h"

// Signed distance of a point above a cube's top face.
int main() {
  ist::GeometryElement cube;
  cube.shape = ist::Box{{0.2, 0.2, 0.2}};
  const ist::Solid solid({cube});
  const double distance = solid.signed_distance({0.02, 0.03, 0.5}).distance;
  std::printf("distance: %g m\n", distance);
  return std::abs(distance - 0.4) < 1e-12 ? 0 : 1;
}
