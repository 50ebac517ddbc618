#include "internal/geometry/ray_cast.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "internal/geometry/ray_bundle.h"
#include "support/allocations.h"
#include "support/meshes.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

using Random = std::mt19937;

Eigen::Vector3d random_direction(Random* random) {
  std::normal_distribution<double> normal;
  return Eigen::Vector3d(normal(*random), normal(*random), normal(*random)).normalized();
}

Eigen::Isometry3d random_pose(Random* random) {
  std::uniform_real_distribution<double> u(-0.2, 0.2);
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() =
      Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), random_direction(random))
          .toRotationMatrix();
  X.translation() = Eigen::Vector3d(u(*random), u(*random), u(*random));
  return X;
}

GeometryElement element(const Shape& shape, const Eigen::Isometry3d& X_LE) {
  return {shape, X_LE, "test"};
}

// The first crossing by a loop over all triangles, by barycentric coordinates (Cramer's rule).
double brute_force(const TriangleMesh& mesh, const Eigen::Vector3d& o, const Eigen::Vector3d& d) {
  double first = kInf;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3d a = mesh.corner(i, 0);
    Eigen::Matrix3d columns;
    columns << mesh.corner(i, 1) - a, mesh.corner(i, 2) - a, -d;
    if (std::abs(columns.determinant()) < 1e-15) continue;
    const Eigen::Vector3d x = columns.inverse() * (o - a);
    constexpr double kEdge = 1e-9;
    if (x[0] < -kEdge || x[1] < -kEdge || x[0] + x[1] > 1.0 + kEdge || x[2] < 0.0) continue;
    first = std::min(first, x[2]);
  }
  return first;
}

struct NamedMesh {
  std::string name;
  TriangleMesh mesh;
};

std::vector<NamedMesh> meshes() {
  return {{"box", test::box({0.3, 0.2, 0.1})},
          {"icosphere", test::icosphere(0.15, 4)},
          {"torus", test::torus(0.15, 0.04, 48, 24)},
          {"open box", test::open_box({0.3, 0.2, 0.1})},
          {"sheet", test::sheet(0.3)},
          {"plate", test::thin_plate(0.3, 1e-4)},
          {"L", test::l_shape(0.4, 0.1)}};
}

// Sensors stand inside, near and up to 30 m away; half of the rays aim at the mesh.
TEST(RayCast, agreesWithALoopOverAllTriangles) {
  Random random(1);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (const NamedMesh& m : meshes()) {
    SCOPED_TRACE(m.name);
    const Eigen::Isometry3d X_LE = random_pose(&random);
    const Solid solid({element(m.mesh, X_LE)});
    int hits = 0;
    for (int i = 0; i < 2000; ++i) {
      const double far = i % 3 == 0 ? 0.05 : i % 3 == 1 ? 1.0 : 30.0;
      const Eigen::Vector3d o = far * random_direction(&random);
      const Eigen::Vector3d target = 0.2 * Eigen::Vector3d(u(random), u(random), u(random));
      const double length = std::exp(3.0 * u(random));
      const Eigen::Vector3d d = length * (target - o).normalized();
      const RayHit hit = ray_cast(solid, X_LE * o, X_LE.linear() * d);
      const double expected = brute_force(m.mesh, o, d);
      ASSERT_EQ(std::isfinite(hit.t), std::isfinite(expected)) << "ray " << i;
      if (!std::isfinite(expected)) continue;
      ++hits;
      ASSERT_NEAR(hit.t * length, expected * length, 1e-9 * (1.0 + far)) << "ray " << i;
      ASSERT_NEAR(hit.normal.norm(), 1.0, 1e-9);
      ASSERT_LE(hit.normal.dot(X_LE.linear() * d), 0.0) << "the normal looks away from the sensor";
      ASSERT_FALSE(std::isfinite(ray_cast(solid, X_LE * o, X_LE.linear() * d, 0.999 * hit.t).t));
      ASSERT_EQ(ray_cast(solid, X_LE * o, X_LE.linear() * d, 1.001 * hit.t).t, hit.t);
    }
    EXPECT_GT(hits, 100);
  }
}

// A camera in the middle of a closed mesh looks through every edge's middle and every corner: a
// traversal that decides edges by rounding loses such rays, and a link has a pinhole there.
TEST(RayCast, noRayPassesThroughAnEdge) {
  for (const NamedMesh& m : meshes()) {
    if (m.name != "box" && m.name != "icosphere") continue;
    SCOPED_TRACE(m.name);
    const Solid solid({element(m.mesh, Eigen::Isometry3d::Identity())});
    for (std::size_t i = 0; i < m.mesh.triangles.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d corner = m.mesh.corner(i, k);
        const Eigen::Vector3d edge = 0.5 * (corner + m.mesh.corner(i, (k + 1) % 3));
        ASSERT_NEAR(ray_cast(solid, Eigen::Vector3d::Zero(), corner).t, 1.0, 1e-9);
        ASSERT_NEAR(ray_cast(solid, Eigen::Vector3d::Zero(), edge).t, 1.0, 1e-9);
      }
    }
  }
}

// The hit is on the surface, and on the way there the ray does not change sides: it is sampled
// every millimetre.
TEST(RayCast, primitivesAreHitWhereTheirDistanceIsZero) {
  Random random(2);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  for (const Shape& shape : {Shape(Box{{0.3, 0.2, 0.1}}), Shape(Cylinder{0.1, 0.3}),
                             Shape(Sphere{0.15}), Shape(Cylinder{0.2, 0.01})}) {
    const Solid solid({element(shape, random_pose(&random))});
    int hits = 0;
    for (int i = 0; i < 1000; ++i) {
      const Eigen::Vector3d o = (i % 4 == 0 ? 0.1 : 0.6) * random_direction(&random);
      Eigen::Vector3d d = (0.2 * Eigen::Vector3d(u(random), u(random), u(random)) - o).normalized();
      if (i % 10 == 0) d = Eigen::Vector3d::Unit(i / 10 % 3);
      const RayHit hit = ray_cast(solid, o, d, 1.5);
      const bool starts_inside = solid.is_inside(o);
      const double end = std::isfinite(hit.t) ? hit.t : 1.5;
      for (double t = 0.0; t < end - 1e-6; t += 0.001) {
        ASSERT_EQ(solid.is_inside(o + t * d), starts_inside) << "ray " << i << " at " << t;
      }
      if (!std::isfinite(hit.t)) continue;
      ++hits;
      const SignedDistance at = solid.signed_distance(o + hit.t * d);
      ASSERT_NEAR(at.distance, 0.0, 1e-9);
      ASSERT_LE(hit.normal.dot(d), 0.0);
      const double step = 1e-7;
      ASSERT_NEAR(std::abs(solid.signed_distance(o + hit.t * d + step * hit.normal).distance), step,
                  1e-3 * step);
    }
    EXPECT_GT(hits, 100);
  }
}

TEST(RayCast, theNearestElementIsHit) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation().z() = 1.0;
  const GeometryElement ball = element(Sphere{0.1}, X);
  X.translation().z() = 2.0;
  const GeometryElement mesh = element(test::box({0.2, 0.2, 0.2}), X);
  for (const LinkGeometry& geometry : {LinkGeometry{ball, mesh}, LinkGeometry{mesh, ball}}) {
    const RayHit hit = ray_cast(Solid(geometry), Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ());
    EXPECT_NEAR(hit.t, 0.9, 1e-12);
    EXPECT_NEAR((hit.normal + Eigen::Vector3d::UnitZ()).norm(), 0.0, 1e-12);
  }
  EXPECT_FALSE(
      std::isfinite(ray_cast(Solid(), Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitZ()).t));
}

// A ray beside a ball, a cylinder and a box's corner, as near as it was made to be.
TEST(RayCast, nearestApproachIsThatOfTheLine) {
  Random random(3);
  std::uniform_real_distribution<double> u(0.001, 0.02);
  for (const Shape& shape : {Shape(Sphere{0.1}), Shape(test::icosphere(0.1, 4))}) {
    const Solid solid({element(shape, Eigen::Isometry3d::Identity())});
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector3d d = random_direction(&random);
      const Eigen::Vector3d side = d.cross(random_direction(&random)).normalized();
      const double miss = u(random);
      const Eigen::Vector3d o = (0.1 + miss) * side - 1.0 * d;
      const RayApproach near = nearest_approach(solid, o, d, 0.99, 0.05);
      ASSERT_NEAR(near.distance, miss, 3e-4) << "the mesh of a ball is up to 0.2 mm too small";
      ASSERT_GE(near.distance, miss - 1e-12);
      ASSERT_NEAR(near.t, 1.0, 0.02);
      ASSERT_FALSE(std::isfinite(nearest_approach(solid, o, d, 0.8, 0.05).distance));
    }
  }
}

// Solids of one mesh; of more leaves than a bundle has room for, of several elements, and of more
// of these than it can list.
std::vector<Solid> solids_for_bundles(Random* random) {
  std::vector<Solid> solids;
  for (const NamedMesh& m : meshes()) {
    solids.push_back(Solid({element(m.mesh, random_pose(random))}));
  }
  solids.push_back(Solid({element(test::icosphere(0.15, 6), random_pose(random))}));
  solids.push_back(Solid({element(test::torus(0.15, 0.04, 48, 24), random_pose(random)),
                          element(Box{{0.1, 0.2, 0.3}}, random_pose(random)),
                          element(Sphere{0.1}, random_pose(random)),
                          element(Cylinder{0.05, 0.3}, random_pose(random))}));
  std::vector<GeometryElement> many;
  for (int i = 0; i < 20; ++i) many.push_back(element(Sphere{0.03}, random_pose(random)));
  solids.push_back(Solid(many));
  return solids;
}

// The rays of a tile of pixels. Sensors stand inside, near and up to 30 m away; the pixels are up
// to 0.1 rad apart. Some pixels may be no numbers, and rays may be cast in two parts.
struct Tile {
  Eigen::Vector3d origin;
  RayBundle::Directions directions;
  std::uint32_t rays, early;
  double max_t;

  bool has(std::uint32_t k) const { return (rays >> k & 1U) != 0; }
};

Tile random_tile(Random* random, int i) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  Tile tile;
  const double range = std::pow(10.0, -1.5 + 1.5 * (u(*random) + 1.0));
  const double apart = std::pow(10.0, -4.0 + 1.5 * (u(*random) + 1.0));
  tile.origin = range * random_direction(random);
  const Eigen::Vector3d aim = 0.25 * random_direction(random) - tile.origin;
  const double length = i % 2 == 0 ? 1.0 : aim.norm();
  for (int k = 0; k < 16; ++k) {
    tile.directions.col(k) = length * (aim.normalized() + apart * random_direction(random));
  }
  tile.rays = i % 5 == 0 ? 0xFFFFU : (*random)() & 0xFFFFU;
  tile.early = i % 7 == 0 ? 0U : (*random)() & tile.rays;
  for (std::uint32_t k = 0; k < 16; ++k) {
    if (!tile.has(k)) tile.directions.col(k).setConstant(std::nan(""));
  }
  tile.max_t = i % 3 == 0 ? kInf : aim.norm() / length;
  return tile;
}

std::array<double, RayBundle::kRays> random_limits(Random* random, double max_t) {
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  std::array<double, RayBundle::kRays> limits;
  for (double& limit : limits) {
    limit = std::isfinite(max_t) ? 0.5 * (u(*random) + 1.0) * max_t : max_t;
  }
  return limits;
}

// What the bundle says of each ray is what a search for it alone says.
TEST(RayBundle, agreesWithSingleRays) {
  Random random(5);
  RayBundle bundle;
  int hits = 0, misses = 0, empty = 0;
  for (const Solid& solid : solids_for_bundles(&random)) {
    for (int i = 0; i < 1600; ++i) {
      const Tile tile = random_tile(&random, i);
      const auto limits = random_limits(&random, tile.max_t);
      const long before = test::allocations;
      bundle.begin(solid, tile.origin, tile.directions, tile.rays, tile.max_t);
      empty += bundle.empty() ? 1 : 0;
      std::array<RayHit, RayBundle::kRays> found;
      bundle.cast(tile.early, limits, &found);
      bundle.cast(tile.rays & ~tile.early, limits, &found);
      for (std::uint32_t k = 0; k < 16; ++k) {
        if (!tile.has(k)) continue;
        const RayHit alone = ray_cast(solid, tile.origin, tile.directions.col(k), limits[k]);
        const RayHit& hit = found[k];
        ASSERT_EQ(std::isfinite(hit.t), std::isfinite(alone.t));
        (std::isfinite(hit.t) ? hits : misses) += 1;
        if (!std::isfinite(hit.t)) continue;
        ASSERT_FALSE(bundle.empty());
        EXPECT_EQ(hit.t, alone.t);
        EXPECT_EQ(hit.normal, alone.normal);
      }
      EXPECT_EQ(test::allocations, before);
    }
  }
  EXPECT_GT(hits, 10000);
  EXPECT_GT(misses, 10000);
  EXPECT_GT(empty, 300);
}

}  // namespace
}  // namespace ist
