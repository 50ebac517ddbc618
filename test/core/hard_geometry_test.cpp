// Exact distances of slivers, needles and triangles without area, against brute force.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "internal/geometry/closest_point_on_triangle.h"
#include "internal/geometry/triangle_bvh.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;

// A degenerate triangle: two long sides and a short one, in any order, down to a line or a point.
std::array<Point, 3> random_sliver(test::Rng* rng) {
  const Point a = test::random_vector(rng, 0.5), along = test::random_vector(rng, 0.5);
  const double width = std::pow(10.0, test::uniform(rng, -18, 0));
  const double where = test::uniform(rng, -1, 2);
  Point b = a + along, c = a + where * along + test::random_vector(rng, width);
  switch (static_cast<int>(test::uniform(rng, 0, 8))) {
    case 0:
      c = a + where * along;
      break;  // a line up to rounding
    case 1:
      c = b;
      break;
    case 2:
      b = c = a;
      break;
    default:
      break;
  }
  std::array<Point, 3> triangle = {a, b, c};
  std::rotate(triangle.begin(), triangle.begin() + static_cast<int>(test::uniform(rng, 0, 3)),
              triangle.end());
  return triangle;
}

TEST(HardGeometry, ClosestPointOnSlivers) {
  test::Rng rng(31);
  for (int i = 0; i < test::scaled(400000); ++i) {
    const auto [a, b, c] = random_sliver(&rng);
    const double u = test::uniform(&rng, 0, 1), v = test::uniform(&rng, 0, 1 - u);
    const double off = std::pow(10.0, test::uniform(&rng, -12, 0));
    const Point p = (1 - u - v) * a + u * b + v * c + test::random_vector(&rng, off);
    const Point q = closest_point_on_triangle(p, a, b, c);
    ASSERT_TRUE(q.allFinite());
    ASSERT_NEAR((q - p).norm(), test::oracle_triangle(p, a, b, c), 1e-8)
        << i << ": " << a.transpose() << ", " << b.transpose() << ", " << c.transpose();
    ASSERT_LT(test::oracle_triangle(q, a, b, c), 1e-8) << i << ": the witness is off the triangle";
  }
}

std::vector<TriangleMesh> thin_meshes() {
  return {test::needle(0.3, 1e-3),
          test::needle(0.3, 1e-5),
          test::needle(3.0, 1e-4),
          test::box({1e-4, 1e-4, 0.3}),
          test::thin_plate(0.2, 1e-5),
          test::sliver_plate(0.3, 0.01, 1e-3, 50),
          test::sliver_plate(1.0, 0.01, 1e-5, 100),
          test::sliver_plate(1.0, 0.01, 1e-3, 1000),
          test::chazelle(4, 0.0005, 0.2)};
}

// A point at a distance of 1e-8 to 0.1 m from a triangle of the mesh.
Point near_surface(const TriangleMesh& mesh, test::Rng* rng) {
  const auto t = static_cast<std::size_t>(test::uniform(rng, 0, 1) *
                                          static_cast<double>(mesh.triangles.size()));
  const double u = test::uniform(rng, 0, 1), v = test::uniform(rng, 0, 1 - u);
  return (1 - u - v) * mesh.corner(t, 0) + u * mesh.corner(t, 1) + v * mesh.corner(t, 2) +
         test::random_vector(rng, std::pow(10.0, test::uniform(rng, -8, -1)));
}

// Bounds in float may prune too little, but never too much.
TEST(HardGeometry, ClosestPointOnThinMeshes) {
  test::Rng rng(32);
  for (const TriangleMesh& mesh : thin_meshes()) {
    const TriangleBvh bvh(mesh);
    const int count = test::scaled(mesh.triangles.size() > 1000 ? 1000 : 5000);
    for (int i = 0; i < count; ++i) {
      const Point p = near_surface(mesh, &rng);
      const double truth = test::oracle_distance(mesh, p);
      const ClosestPoint closest = bvh.closest(p);
      ASSERT_NEAR(std::sqrt(closest.distance_sq), truth, 1e-9) << p.transpose();
      ASSERT_LT(test::oracle_distance(mesh, closest.point), 1e-9);
    }
  }
}

// Regression: the solid angle of a sliver, at a distance below its width, is a small difference
// of large float products. Its sign was random, so that points up to 4e-6 m outside a needle 0.3 m
// long and 1e-5 m thick counted as inside.
TEST(HardGeometry, InsideOfThinMeshes) {
  test::Rng rng(33);
  for (const TriangleMesh& mesh : thin_meshes()) {
    const TriangleBvh bvh(mesh);
    // Points within the rounding error of float coordinates are skipped.
    const double rounding = 2e-7 * test::bounds(mesh).sizes().norm();
    const int count = test::scaled(mesh.triangles.size() > 1000 ? 1000 : 5000);
    for (int i = 0; i < count; ++i) {
      const Point p = near_surface(mesh, &rng);
      if (test::oracle_distance(mesh, p) < rounding) continue;
      const double truth = test::oracle_winding(mesh, p);
      ASSERT_EQ(bvh.is_inside(p), truth > 0.5)
          << p.transpose() << " at " << test::oracle_distance(mesh, p);
      ASSERT_NEAR(bvh.winding_number(p), truth, 0.01) << p.transpose();
      ASSERT_NEAR(bvh.quick_winding_number(p), truth, TriangleBvh::kQuickWindingError)
          << p.transpose();
    }
  }
}

}  // namespace
}  // namespace ist
