#include "ist_proximity/geometry/solid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/geometry/solid_queries.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

Solid solid_of(const Shape& shape, const Eigen::Isometry3d& X_LE = Eigen::Isometry3d::Identity()) {
  return Solid({GeometryElement{shape, X_LE, "test"}});
}

void expect_consistent(const SignedDistance& result, const Eigen::Vector3d& p) {
  EXPECT_NEAR(result.normal.norm(), 1.0, 1e-9);
  EXPECT_TRUE((p - result.witness).isApprox(result.distance * result.normal, 1e-9) ||
              std::abs(result.distance) < 1e-9)
      << p.transpose();
}

TEST(Solid, BoxAndItsMeshAgree) {
  test::Rng rng(3);
  const Eigen::Isometry3d X = test::random_pose(&rng, 0.2);
  const Eigen::Vector3d size(0.2, 0.1, 0.4);
  const Solid primitive = solid_of(Box{size}, X), mesh = solid_of(test::box(size), X);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = test::random_vector(&rng, 0.4);
    const SignedDistance a = primitive.signed_distance(p), b = mesh.signed_distance(p);
    ASSERT_NEAR(a.distance, b.distance, 1e-12);
    ASSERT_EQ(primitive.is_inside(p), a.distance < 0.0);
    expect_consistent(a, p);
    expect_consistent(b, p);
  }
}

TEST(Solid, CylinderIsTheCylinder) {
  test::Rng rng(4);
  const Cylinder cylinder{0.1, 0.3};
  const Solid solid = solid_of(cylinder);
  for (int i = 0; i < 2000; ++i) {
    const Eigen::Vector3d p = test::random_vector(&rng, 0.3);
    const double wall = std::hypot(p.x(), p.y()) - 0.1, cap = std::abs(p.z()) - 0.15;
    const double expected = wall < 0 && cap < 0
                                ? std::max(wall, cap)
                                : std::hypot(std::max(wall, 0.0), std::max(cap, 0.0));
    const SignedDistance result = solid.signed_distance(p);
    ASSERT_NEAR(result.distance, expected, 1e-12);
    expect_consistent(result, p);
  }
  EXPECT_NEAR(solid.signed_distance({0, 0, 0.2}).distance, 0.05, 1e-15) << "on the axis";
  EXPECT_NEAR(solid.signed_distance({0, 0, 0}).distance, -0.1, 1e-15);
}

TEST(Solid, NormalIsDefinedOnTheSurfaceAndAtCentres) {
  for (const Shape& shape :
       {Shape(Box{{0.2, 0.2, 0.2}}), Shape(Cylinder{0.1, 0.2}), Shape(Sphere{0.1}),
        Shape(test::box({0.2, 0.2, 0.2})), Shape(test::inside_out(test::box({0.2, 0.2, 0.2})))}) {
    const Solid solid = solid_of(shape);
    for (const Eigen::Vector3d& p : {Eigen::Vector3d(0.1, 0, 0), Eigen::Vector3d(0, 0, 0)}) {
      const SignedDistance result = solid.signed_distance(p);
      EXPECT_NEAR(result.normal.norm(), 1.0, 1e-12);
      EXPECT_TRUE(result.witness.allFinite());
    }
    if (shape.index() != 3) {
      EXPECT_NEAR(solid.signed_distance({0.1, 0, 0}).normal.x(), 1.0, 1e-9);
    }
  }
}

TEST(Solid, UnionTakesTheNearestOutsideAndTheDeepestInside) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation().x() = 0.15;
  const Solid solid({GeometryElement{Sphere{0.1}, Eigen::Isometry3d::Identity(), "a"},
                     GeometryElement{Sphere{0.1}, X, "b"}});
  EXPECT_NEAR(solid.signed_distance({0.35, 0, 0}).distance, 0.1, 1e-15);
  EXPECT_NEAR(solid.signed_distance({0.06, 0, 0}).distance, -0.04, 1e-15);
  EXPECT_NEAR(solid.signed_distance({0.15, 0, 0}).distance, -0.1, 1e-15);
}

// Solids with and without holes, of one element and of several: the depth is exact where it is
// needed, and a bound elsewhere.
TEST(Solid, DepthEqualsTheSignedDistanceWhereItIsNeeded) {
  test::Rng rng(8);
  const GeometryElement closed{test::box({0.2, 0.2, 0.4}), Eigen::Isometry3d::Identity(), "box"};
  const GeometryElement open{test::open_box({0.2, 0.3, 0.2}), test::random_pose(&rng, 0.1), "open"};
  const GeometryElement round{Cylinder{0.1, 0.3}, test::random_pose(&rng, 0.1), "cylinder"};
  const std::vector<LinkGeometry> links = {{closed}, {open}, {round}, {closed, open, round}};
  for (const LinkGeometry& link : links) {
    const Solid solid(link);
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.2);
      const double enough = test::uniform(&rng, -0.1, 0.1);
      const double expected = solid.signed_distance(p).distance;
      const PointDepth depth = point_depth(solid, p, enough);
      if (std::isfinite(depth.exact.distance)) {
        ASSERT_NEAR(depth.exact.distance, expected, 1e-12);
        expect_consistent(depth.exact, p);
      } else {
        ASSERT_GE(expected, -enough - 1e-12);
      }
      ASSERT_LE(depth.floor, expected + 1e-12);
      const Eigen::Vector3d q = p + test::random_vector(&rng, 0.05);
      ASSERT_LE(depth.floor - (q - p).norm(), solid.signed_distance(q).distance + 1e-12);
    }
  }
}

TEST(Solid, MeshEqualsBruteForceInsideAndOut) {
  test::Rng rng(5);
  for (const TriangleMesh& mesh : {test::l_shape(0.3, 0.06), test::torus(0.2, 0.06, 30, 16),
                                   test::open_box({0.2, 0.2, 0.3})}) {
    const Solid solid = solid_of(mesh);
    for (int i = 0; i < 500; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.3);
      if (std::abs(test::oracle_winding(mesh, p) - 0.5) < 0.005) continue;
      const SignedDistance result = solid.signed_distance(p);
      ASSERT_NEAR(result.distance, test::oracle_signed_distance(mesh, p), 1e-12);
      expect_consistent(result, p);
      if (result.distance > 0.0) {
        EXPECT_EQ(distance_outside(solid, p, 2.0 * result.distance).distance, result.distance);
        EXPECT_TRUE(std::isinf(distance_outside(solid, p, 0.9 * result.distance).distance));
      }
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
