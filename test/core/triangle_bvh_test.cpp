#include "internal/geometry/triangle_bvh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/closest_point_on_triangle.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

std::vector<TriangleMesh> meshes() {
  return {test::box({0.1, 0.2, 0.3}),
          test::icosphere(0.2, 3),
          test::torus(0.3, 0.05, 40, 20),
          test::open_box({0.2, 0.2, 0.4}),
          test::thin_plate(0.4, 0.0005),
          test::sheet(0.3),
          test::l_shape(0.3, 0.06),
          test::joined(test::icosphere(0.1, 2), test::box({0.3, 0.05, 0.05}))};
}

// Of any shape: a hierarchy gives the corner with the largest angle first, other callers do not. At
// an obtuse corner, both edges can face a point whose closest point is on the farther one.
TEST(ClosestPointOnTriangle, EqualsBruteForce) {
  test::Rng rng(21);
  for (int i = 0; i < 100000; ++i) {
    const Eigen::Vector3d a = test::random_vector(&rng, 1.0), b = test::random_vector(&rng, 1.0),
                          c = test::random_vector(&rng, 1.0), p = test::random_vector(&rng, 2.0);
    const Eigen::Vector3d q = closest_point_on_triangle(p, a, b, c);
    ASSERT_NEAR((p - q).norm(), test::oracle_triangle(p, a, b, c), 1e-9) << i;
  }
}

TEST(TriangleBvh, ClosestPointEqualsBruteForce) {
  test::Rng rng(1);
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, i % 3 == 0 ? 2.0 : 0.3);
      const ClosestPoint closest = bvh.closest(p);
      const double expected = test::oracle_distance(mesh, p);
      ASSERT_NEAR(std::sqrt(closest.distance_sq), expected, 1e-12);
      ASSERT_NEAR((closest.point - p).norm(), expected, 1e-12);
      ASSERT_LT(
          test::oracle_triangle(closest.point, mesh.corner(closest.triangle, 0),
                                mesh.corner(closest.triangle, 1), mesh.corner(closest.triangle, 2)),
          1e-9)
          << "the witness must lie on the returned triangle";
    }
  }
}

TEST(TriangleBvh, ClosestPointKeepsToItsRange) {
  const TriangleBvh bvh(test::box({2, 2, 2}));
  EXPECT_TRUE(std::isinf(bvh.closest({3, 0, 0}, 3.9).distance_sq));
  EXPECT_DOUBLE_EQ(bvh.closest({3, 0, 0}, 4.0).distance_sq, 4.0);
  EXPECT_TRUE(std::isinf(TriangleBvh().closest({0, 0, 0}).distance_sq));
}

// Calls check(bvh, point, direction, distance) for points about all meshes.
template <typename Check>
void for_each_place(test::Rng* rng, const Check& check) {
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d p = test::random_vector(rng, i % 3 == 0 ? 2.0 : 0.3);
      const Eigen::Vector3d toward = test::random_vector(rng, 1.0).normalized();
      check(bvh, p, toward, test::oracle_distance(mesh, p));
    }
  }
}

TEST(TriangleBvh, DirectionNeverChangesTheClosestPoint) {
  test::Rng rng(3);
  for_each_place(&rng, [](const TriangleBvh& bvh, const Eigen::Vector3d& p,
                          const Eigen::Vector3d& toward, double expected) {
    ASSERT_NEAR(std::sqrt(bvh.closest(p, 100.0, toward).distance_sq), expected, 1e-12);
  });
}

TEST(TriangleBvh, ClosestPointMayBeALittleFarther) {
  test::Rng rng(7);
  for_each_place(&rng, [&rng](const TriangleBvh& bvh, const Eigen::Vector3d& p,
                              const Eigen::Vector3d& toward, double expected) {
    const double slack = std::pow(10.0, test::uniform(&rng, -6, -1));
    const ClosestPoint closest = bvh.closest(p, 100.0, toward, 0.0, slack);
    const double found = std::sqrt(closest.distance_sq);
    ASSERT_GE(found, expected - 1e-12);
    ASSERT_LE(closest.lower_bound, expected + 1e-12);
    ASSERT_GE(closest.lower_bound, found - slack - 1e-12);
    const ClosestPoint exact = bvh.closest(p, 100.0, toward);
    ASSERT_EQ(exact.lower_bound, std::sqrt(exact.distance_sq));
    const double less = 0.9 * expected;
    ASSERT_NEAR(bvh.closest(p, less * less, toward, 0.0, slack).lower_bound, less, 1e-12);
  });
}

TEST(TriangleBvh, ClosestPointSearchStopsAtAPointThatIsNearEnough) {
  test::Rng rng(5);
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.3);
      const double expected = test::oracle_distance(mesh, p);
      const double enough = expected * test::uniform(&rng, 0.5, 2.0);
      const double found =
          std::sqrt(bvh.closest(p, 100.0, Eigen::Vector3d::Zero(), enough * enough).distance_sq);
      ASSERT_GE(found, expected - 1e-12);
      ASSERT_LE(found, std::max(expected, enough) + 1e-12);
    }
  }
}

TEST(TriangleBvh, SupportEqualsBruteForce) {
  test::Rng rng(4);
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 300; ++i) {
      Eigen::Vector3d n = test::random_vector(&rng, 1.0).normalized();
      if (i < 6) n = (i % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(i / 2);
      double expected = -std::numeric_limits<double>::infinity();
      for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (int k = 0; k < 3; ++k) expected = std::max(expected, n.dot(mesh.corner(t, k)));
      }
      ASSERT_NEAR(bvh.support(n), expected, 1e-12);
      const double loose = bvh.support(n, 0.01);
      ASSERT_GE(loose, expected - 1e-15);
      ASSERT_LE(loose, expected + 0.01 + 1e-12);
      const double reached = n.dot(mesh.corner(0, 0));
      ASSERT_NEAR(bvh.support(n, 0.0, reached), expected, 1e-12);
      ASSERT_EQ(bvh.support(n, 0.0, expected + 0.1), expected + 0.1);
    }
  }
  EXPECT_EQ(TriangleBvh().support({1, 0, 0}), -std::numeric_limits<double>::infinity());
}

TEST(TriangleBvh, SupportWithinASphereIsNoLessThanAnyPointThere) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  test::Rng rng(8);
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d center = test::random_vector(&rng, 0.2);
      const Eigen::Vector3d n = test::random_vector(&rng, 1.0).normalized();
      const double radius = test::uniform(&rng, 0.005, 0.2);
      const double support = bvh.support_in_sphere(center, radius, n);
      double sampled = -kInfinity;
      for (int sample = 0; sample < 4000; ++sample) {
        const auto t = static_cast<std::size_t>(sample) % mesh.triangles.size();
        const double u = test::uniform(&rng, 0, 1), v = test::uniform(&rng, 0, 1 - u);
        const Eigen::Vector3d x = mesh.corner(t, 0) * (1 - u - v) + mesh.corner(t, 1) * u +
                                  mesh.corner(t, 2) * v - center;
        if (x.norm() <= radius) sampled = std::max(sampled, n.dot(x));
      }
      ASSERT_GE(support, sampled - 1e-12);
      ASSERT_LE(support, radius + 1e-12);
      const double tolerance = 1e-3;
      const double loose = bvh.support_in_sphere(center, radius, n, tolerance);
      ASSERT_GE(loose, support);
      if (support > -kInfinity) ASSERT_LE(loose, support + tolerance);
      // What is known already is not found to be less.
      if (support > -kInfinity) {
        ASSERT_NEAR(bvh.support_in_sphere(center, radius, n, 0.0, support - 1e-3), support, 1e-15);
      }
      ASSERT_NEAR(bvh.support_in_sphere(center, radius, n, 0.0, radius), radius, 1e-15);
    }
  }
  EXPECT_EQ(TriangleBvh().support_in_sphere({0, 0, 0}, 1.0, {1, 0, 0}), -kInfinity);
}

TEST(TriangleBvh, WindingNumberEqualsTheSumOverAllTriangles) {
  test::Rng rng(2);
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.3);
      const double expected = test::oracle_winding(mesh, p);
      ASSERT_NEAR(bvh.winding_number(p), expected, 0.01);
      ASSERT_NEAR(bvh.quick_winding_number(p), expected, TriangleBvh::kQuickWindingError);
      if (std::abs(expected - 0.5) > 0.01) {
        ASSERT_EQ(bvh.is_inside(p), expected > 0.5);
      }
    }
  }
}

// Where sheets lie one on another, or one in another, the errors of the expansion add up.
TEST(TriangleBvh, ErrorOfTheQuickWindingNumberGrowsWithTheSheets) {
  test::Rng rng(28);
  double largest = 0.0;
  int near_half = 0;
  for (const double step : {0.0, 0.012, 0.1}) {
    for (const int sheets : {1, 2, 8}) {
      TriangleMesh mesh;
      for (int i = 0; i < sheets; ++i) {
        // A sphere that is cut open.
        const TriangleMesh sphere = test::icosphere(0.1 * (1.0 - step * i), 3);
        const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.insert(mesh.vertices.end(), sphere.vertices.begin(), sphere.vertices.end());
        for (TriangleMesh::Triangle triangle : sphere.triangles) {
          if (sphere.vertices[triangle[0]].z() > 0.06) continue;
          for (auto& vertex : triangle) vertex += first;
          mesh.triangles.push_back(triangle);
        }
      }
      const TriangleBvh bvh(mesh);
      for (int i = 0; i < test::scaled(400); ++i) {
        Eigen::Vector3d p = test::random_vector(&rng, 0.12);
        if (i % 2 == 0) p.z() = 0.06 + 0.02 * p.z() / 0.12;  // about the rim
        double error;
        const double quick = bvh.quick_winding_number(p, &error);
        const double w = test::oracle_winding(mesh, p);
        ASSERT_LE(std::abs(quick - w), error) << sheets << " sheets, " << p.transpose();
        ASSERT_GE(error, TriangleBvh::kQuickWindingError);
        largest = std::max(largest, std::abs(quick - w));
        if (std::abs(w - 0.5) < 0.02) continue;
        near_half += std::abs(w - 0.5) < 0.2 ? 1 : 0;
        ASSERT_EQ(bvh.is_inside(p), w > 0.5) << sheets << " sheets, " << p.transpose();
      }
    }
  }
  EXPECT_GT(largest, 0.15);
  EXPECT_GT(near_half, test::scaled(100));
}

// The root mean square error of the expansion over points about a turned, open mesh. It is far
// below the largest one: 4.3e-5, and 9.0e-5 without one of the terms of second order.
TEST(TriangleBvh, WindingNumberIsExpandedToSecondOrder) {
  test::Rng rng(12);
  double sum_sq = 0.0;
  int count = 0;
  for (int i = 0; i < 30; ++i) {
    TriangleMesh mesh = test::icosphere(0.1, 4);
    mesh.triangles.resize(mesh.triangles.size() / 2);
    for (Eigen::Vector3d& v : mesh.vertices) v = v.cwiseProduct(Eigen::Vector3d(1.0, 0.6, 0.3));
    mesh = test::moved(mesh, test::random_pose(&rng, 0.0));
    const TriangleBvh bvh(mesh);
    for (int k = 0; k < 100; ++k, ++count) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.3);
      const double error = bvh.winding_number(p) - test::oracle_winding(mesh, p);
      sum_sq += error * error;
    }
  }
  const double rms = std::sqrt(sum_sq / count);
  std::printf("winding number: root mean square error %.3g\n", rms);
  EXPECT_LT(rms, 6e-5);
}

TEST(TriangleBvh, TrianglesWithoutAreaAreSurfaceToo) {
  const TriangleMesh needle{{{0, 0, 0}, {1, 0, 0}, {0.5, 0, 0}}, {{0, 1, 2}, {0, 0, 0}}};
  const TriangleBvh bvh(needle);
  EXPECT_DOUBLE_EQ(bvh.closest({0.7, 0.3, 0}).distance_sq, 0.09);
  EXPECT_DOUBLE_EQ(bvh.winding_number({0.7, 0.3, 0}), 0.0);
}

// The normal of an area of 1e-200 m^2 has the squared length 0. Divided by it, the direction of the
// slab was NaN, and became an integer: undefined, as clang's sanitizer found (a fuzzed URDF with a
// box of 1e-299 m); with GCC it was 0 by luck, which means no slab. At 1e-160 m the quotient of two
// squares had lost its digits: a distance 3.3 um too long, and so was its lower bound.
TEST(TriangleBvh, AreasWhoseSquareIsZeroAreSurfaceToo) {
  for (const double width : {1e-100, 1e-154, 1e-160, 1e-200, 1e-299, 1e-310}) {
    const TriangleMesh sliver{{{0, 0, 0}, {width, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}};
    const TriangleBvh bvh(sliver);
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.3, 0.5, 0), Eigen::Vector3d(0, 0.5, -0.3)}) {
      EXPECT_NEAR(bvh.closest(p).distance_sq, 0.09, 1e-12) << width;
      EXPECT_LE(bvh.closest(p).lower_bound, 0.3) << width;
    }
  }
}

}  // namespace
}  // namespace ist
