#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/solid_queries.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/geometry/solid.h"
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

// With any direction to begin with, any point that is near enough, and any slack.
TEST(TriangleBvh, ClosestPointEqualsBruteForce) {
  test::Rng rng(1);
  for (const TriangleMesh& mesh : meshes()) {
    const TriangleBvh bvh(mesh);
    for (int i = 0; i < 600; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, i % 3 == 0 ? 2.0 : 0.3);
      const Eigen::Vector3d toward =
          i % 2 == 0 ? Eigen::Vector3d(0, 0, 0) : test::random_vector(&rng, 1.0).normalized();
      const double expected = test::oracle_distance(mesh, p);
      const ClosestPoint exact = bvh.closest(p, 100.0, toward);
      ASSERT_NEAR(std::sqrt(exact.distance_sq), expected, 1e-12);
      ASSERT_EQ(exact.lower_bound, std::sqrt(exact.distance_sq));
      ASSERT_NEAR((exact.point - p).norm(), expected, 1e-12);
      ASSERT_LT(
          test::oracle_triangle(exact.point, mesh.corner(exact.triangle, 0),
                                mesh.corner(exact.triangle, 1), mesh.corner(exact.triangle, 2)),
          1e-9)
          << "the witness must lie on the returned triangle";
      const double enough = expected * test::uniform(&rng, 0.5, 2.0);
      const double near = std::sqrt(bvh.closest(p, 100.0, toward, enough * enough).distance_sq);
      ASSERT_GE(near, expected - 1e-12);
      ASSERT_LE(near, std::max(expected, enough) + 1e-12);
      const double slack = std::pow(10.0, test::uniform(&rng, -6, -1));
      const ClosestPoint loose = bvh.closest(p, 100.0, toward, 0.0, slack);
      ASSERT_GE(std::sqrt(loose.distance_sq), expected - 1e-12);
      ASSERT_LE(loose.lower_bound, expected + 1e-12);
      ASSERT_GE(loose.lower_bound, std::sqrt(loose.distance_sq) - slack - 1e-12);
      const double less = 0.9 * expected;
      ASSERT_NEAR(bvh.closest(p, less * less, toward, 0.0, slack).lower_bound, less, 1e-12);
    }
  }
}

TEST(TriangleBvh, ClosestPointKeepsToItsRange) {
  const TriangleBvh bvh(test::box({2, 2, 2}));
  EXPECT_TRUE(std::isinf(bvh.closest({3, 0, 0}, 3.9).distance_sq));
  EXPECT_DOUBLE_EQ(bvh.closest({3, 0, 0}, 4.0).distance_sq, 4.0);
  EXPECT_TRUE(std::isinf(TriangleBvh().closest({0, 0, 0}).distance_sq));
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

// A sphere that is cut open.
TriangleMesh cut_sphere(double radius) {
  TriangleMesh sphere = test::icosphere(radius, 3);
  const auto is_cut_off = [&](const TriangleMesh::Triangle& triangle) {
    return sphere.vertices[triangle[0]].z() > 0.06;
  };
  auto& triangles = sphere.triangles;
  triangles.erase(std::remove_if(triangles.begin(), triangles.end(), is_cut_off), triangles.end());
  return sphere;
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
        mesh = test::joined(mesh, cut_sphere(0.1 * (1.0 - step * i)));
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

// The first part of a surface that is near enough ends the search; the answer is that of the whole.
TEST(Solid, WithinDistanceAsTheNearestElementSays) {
  test::Rng rng(6);
  const auto pose = [&rng] { return test::random_pose(&rng, 0.2); };
  std::size_t within = 0, farther = 0;
  for (int trial = 0; trial < test::scaled(40); ++trial) {
    const LinkGeometry geometry = {{test::torus(0.2, 0.06, 30, 16), pose(), "torus"},
                                   {Box{{0.1, 0.2, 0.1}}, pose(), "box"},
                                   {test::l_shape(0.3, 0.06), pose(), "l"}};
    const Solid solid(geometry);
    for (int i = 0; i < 200; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.4);
      const double infinity = std::numeric_limits<double>::infinity();
      const double distance = distance_outside(solid, p, infinity).distance;
      for (const double share : {0.5, 1.0 - 1e-7, 1.0 + 1e-7, 2.0}) {
        const double limit = share * std::abs(distance);
        EXPECT_EQ(is_within_distance(solid, p, limit), distance <= limit) << share;
        ++(distance <= limit ? within : farther);
      }
    }
  }
  EXPECT_GT(within, static_cast<std::size_t>(test::scaled(10000)));
  EXPECT_GT(farther, static_cast<std::size_t>(test::scaled(10000)));
}

}  // namespace
}  // namespace ist
