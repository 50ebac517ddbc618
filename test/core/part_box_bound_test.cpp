// Bounds of a convex part and a box, which pairs of large parts and small boxes are pruned by.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <random>
#include <vector>

#include "internal/geometry/convex_part.h"
#include "internal/geometry/surface_bvh.h"
#include "ist_proximity/geometry/solid.h"
#include "proximity/surface_pair_search.h"
#include "support/meshes.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"

namespace ist {
namespace {

using Kind = ConvexPart::Kind;

struct TiltedBox {
  Eigen::Vector3d center;
  Eigen::Matrix3d axes;
  Eigen::Vector3d half;
};

// [m] The distance of a part to the faces of a box.
double distance_to_faces(const ConvexPart& part, const TiltedBox& box) {
  double least = std::numeric_limits<double>::infinity();
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {-1.0, 1.0}) {
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      const auto corner = [&](double at_u, double at_v) {
        Eigen::Vector3d p = side * box.half[axis] * Eigen::Vector3d::Unit(axis);
        p[u] = at_u * box.half[u];
        p[v] = at_v * box.half[v];
        return Eigen::Vector3d(box.center + box.axes * p);
      };
      for (const double turn : {-1.0, 1.0}) {
        ConvexPart face;
        face.a = corner(-1.0, turn);
        face.b = corner(1.0, -turn);
        face.c = corner(turn, turn);
        least = std::min(least, convex_distance(part, face).distance);
      }
    }
  }
  return least;
}

ConvexPart random_part(std::mt19937_64* rng, int which) {
  const double size = test::power_of_ten(rng, -3.0, 0.0);
  ConvexPart part;
  part.a = test::random_vector(rng, 0.5);
  part.b = part.a + test::random_vector(rng, size);
  part.c = part.a + test::random_vector(rng, size);
  if (which == 0) return part;
  if (which == 1) {  // a sliver
    part.c = part.b + 1e-7 * test::random_vector(rng, 1.0);
    return part;
  }
  part.kind = which == 2 ? Kind::kSphere : Kind::kCylinder;
  part.radius = test::uniform(rng, 0.1, 1.0) * size;
  part.b = test::random_vector(rng, size);
  return part;
}

TEST(PartBoxBound, HoldsAndIsTightForSmallBoxes) {
  std::mt19937_64 rng(5);
  int apart = 0;
  for (int i = 0; i < test::scaled(40000); ++i) {
    const ConvexPart part = random_part(&rng, i % 4);
    TiltedBox box;
    box.center = test::random_vector(&rng, 1.0);
    box.axes = test::random_pose(&rng, 1.0).linear();
    const double size = test::power_of_ten(&rng, -4.0, 0.0);
    for (double& half : box.half) half = size * test::uniform(&rng, 0.0, 1.0);
    const double bound = box_bound(part, box.center, box.axes, box.half);
    const double distance = distance_to_faces(part, box);
    ASSERT_GE(bound, 0.0);
    ASSERT_LE(bound, std::max(distance, 0.0) + 1e-11) << "case " << i;
    if (bound > 0.0) {
      ++apart;
      ASSERT_GE(bound, distance - 2.0 * box.half.norm() - 1e-11) << "case " << i;
    }
  }
  EXPECT_GT(apart, test::scaled(40000) / 3);
}

// Triangles whose boxes hold another part of the surface, too, and thousands of small ones: what is
// far from the closest points is pruned by the triangles themselves.
TEST(PartBoxBound, PrunesLargeTrianglesBesideSmallOnes) {
  GeometryElement link, ring;
  link.shape = Box{{0.05, 0.09, 0.11}};
  ring.shape = test::torus(0.08, 0.02, 96, 48);
  const SurfaceBvh a{Solid({link})}, b{Solid({ring})};
  std::mt19937_64 rng(9);
  int most = 0;
  for (int i = 0; i < test::scaled(200); ++i) {
    SurfacePairSearch search(a, b, 1024);
    Eigen::Isometry3d X = test::random_pose(&rng, 1.0);
    X.translation() = test::uniform(&rng, 0.2, 0.6) * test::random_vector(&rng, 1.0).normalized();
    search.move_to(X, std::numeric_limits<double>::infinity());
    constexpr int kEnough = 1000000;
    int steps = kEnough;
    ASSERT_TRUE(search.run({1.0, 1e-3, 0.0}, &steps));
    most = std::max(most, kEnough - steps);
  }
  std::printf("at most %d pairs\n", most);
  EXPECT_LT(most, 500);
}

}  // namespace
}  // namespace ist
