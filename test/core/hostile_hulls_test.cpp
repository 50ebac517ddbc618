// Surfaces of many triangles, whose hierarchies have hulls of nodes, in poses that make hulls fail:
// stretched to needles and plates, far from their frame's origin, one in a hollow of the other, a
// hair apart. Bounds hold at every answer, against brute force in double.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "internal/geometry/hull_distance.h"
#include "internal/geometry/surface_bvh.h"
#include "ist_proximity/geometry/solid.h"
#include "proximity/surface_pair_search.h"
#include "support/link_pair_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

TriangleMesh random_body(test::Rng* rng) {
  TriangleMesh mesh;
  switch (test::below(rng, 5)) {
    case 0:
      mesh = test::torus(0.1, test::uniform(rng, 0.01, 0.06), 24, 12);
      break;
    case 1:
      mesh = test::icosphere(0.1, 3);
      for (Eigen::Vector3d& v : mesh.vertices) v *= test::uniform(rng, 0.6, 1.1);
      break;
    case 2:
      mesh = test::random_soup(rng, 400);
      break;
    case 3:
      mesh = test::joined(test::icosphere(0.05, 2),
                          test::moved(test::icosphere(0.04, 2),
                                      Eigen::Isometry3d(Eigen::Translation3d(0.2, 0.0, 0.0))));
      break;
    default:  // a bowl: the other one may be in its hollow
      mesh = test::icosphere(0.12, 3);
      mesh.triangles.resize(mesh.triangles.size() / 2);
  }
  Eigen::Vector3d stretch(1.0, 1.0, 1.0);
  for (int k = 0; k < 3; ++k) {
    if (test::chance(rng, 0.3)) stretch[k] = test::power_of_ten(rng, -5.0, 0.5);
  }
  Eigen::Vector3d away = Eigen::Vector3d::Zero();
  if (test::chance(rng, 0.3)) {
    away = test::random_vector(rng, test::power_of_ten(rng, -1.0, 3.0));
  }
  const Eigen::Matrix3d turn = test::random_pose(rng, 0.0).linear();
  for (Eigen::Vector3d& v : mesh.vertices) v = turn * stretch.cwiseProduct(v) + away;
  return mesh;
}

struct Body {
  explicit Body(const TriangleMesh& mesh)
      : solid(test::one(mesh)), bvh(solid), triangles(test::triangles_of(test::one(mesh))) {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v);
    middle = box.center();
  }
  Solid solid;
  SurfaceBvh bvh;
  test::TriangleGroups triangles;
  Eigen::Vector3d middle;
};

// Middles near one another, or a hair between the surfaces along the closest points.
Eigen::Isometry3d next_pose(test::Rng* rng, const Body& a, const Body& b,
                            const SurfacePairSearch& search, const Eigen::Isometry3d& X_BA) {
  if (test::chance(rng, 0.2) || !(search.distance() > 1e-9)) {
    Eigen::Isometry3d X = test::random_pose(rng, 0.0);
    X.translation() = b.middle - X.linear() * a.middle +
                      test::random_vector(rng, test::power_of_ten(rng, -2.5, -0.3));
    return X;
  }
  Eigen::Isometry3d X = X_BA;
  const Eigen::Vector3d gap = search.closest().on_p - search.closest().on_q;
  if (test::chance(rng, 0.5) && gap.allFinite() && gap.norm() > 1e-9) {
    const double wanted = test::power_of_ten(rng, -9.0, -2.0);
    X.translation() += gap.normalized() * (wanted - gap.norm());
    return X;
  }
  const Eigen::Isometry3d turn = test::small_motion(rng, -1.5);
  const Eigen::Vector3d middle = X * a.middle;
  X.linear() = turn.linear() * X.linear();
  X.translation() = middle - X.linear() * a.middle + turn.translation();
  return X;
}

// [m] Of the corners, from the pose that the search refers to.
double motion_of(const Body& a, const SurfacePairSearch& search, const Eigen::Isometry3d& X_BA) {
  double moved = 0.0;
  for (const ConvexPart& part : a.bvh.parts()) {
    for (const Eigen::Vector3d& p : {part.a, part.b, part.c}) {
      moved = std::max(moved, (X_BA * p - search.reference_pose() * p).norm());
    }
  }
  return moved;
}

TEST(HostileHulls, BoundsHold) {
  test::Rng rng(2321);
  int apart = 0, touching = 0, near = 0;
  const int pairs = test::scaled(120);
  for (int i = 0; i < pairs && !testing::Test::HasFailure(); ++i) {
    const Body a(random_body(&rng)), b(random_body(&rng));
    // A front that is soon full sets pairs aside.
    SurfacePairSearch search(a.bvh, b.bvh, i % 3 == 0 ? 2 * SurfaceBvh::kWidth : 512);
    Eigen::Isometry3d X_BA = Eigen::Isometry3d::Identity();
    for (int step = 0; step < 20; ++step) {
      const double old = search.lower_bound();
      X_BA = next_pose(&rng, a, b, search, X_BA);
      const double scale = 1.0 + a.bvh.extent() + b.bvh.extent() + X_BA.translation().norm();
      // What moves is not bounded here: every second pose is searched anew.
      const double moved = step % 2 == 1 ? motion_of(a, search, X_BA) + 1e-12 * scale
                                         : std::numeric_limits<double>::infinity();
      search.move_to(X_BA, moved);
      constexpr double kTolerances[] = {0.0, 1e-6, 1e-3, 0.02};
      const double tolerance = kTolerances[test::below(&rng, 4)];
      int steps = test::chance(&rng, 0.2) ? static_cast<int>(test::below(&rng, 30)) : 100000000;
      const bool is_complete = search.run({1e5, tolerance, 0.0}, &steps);
      const double truth = b.triangles.distance(a.triangles, X_BA);
      const double rounding = 1e-13 * scale;
      const std::string where = "pair " + std::to_string(i) + ", step " + std::to_string(step) +
                                ", scale " + std::to_string(scale) + ", before " +
                                std::to_string(old);
      ASSERT_LE(search.lower_bound(), truth + rounding) << where;
      ASSERT_LE(search.separation(), truth + rounding) << where;
      ASSERT_GE(search.distance(), truth - rounding) << where;
      if (is_complete && truth > rounding) {
        ASSERT_LE(search.distance() - search.lower_bound(),
                  tolerance + 2e-5 * scale + 2.0 * search.rounding())
            << where << ", distance " << search.distance() << ", truth " << truth << ", bound "
            << search.lower_bound() << ", tolerance " << tolerance << ", steps " << steps;
      }
      ++(truth > rounding ? apart : touching);
      near += truth > rounding && truth < 1e-4 ? 1 : 0;
    }
  }
  EXPECT_GT(apart, 20 * pairs / 2);
  EXPECT_GT(touching, 20 * pairs / 50);
  EXPECT_GT(near, 20 * pairs / 20);
}

// Coresets of convex hulls, and lower bounds of the distance of surfaces by them.

using Point = Eigen::Vector3d;

std::vector<ConvexPart> parts_of(const TriangleMesh& mesh) {
  std::vector<ConvexPart> parts(mesh.triangles.size());
  for (std::size_t t = 0; t < parts.size(); ++t) {
    parts[t].a = mesh.corner(t, 0);
    parts[t].b = mesh.corner(t, 1);
    parts[t].c = mesh.corner(t, 2);
  }
  return parts;
}

// All corners at random on a line, in a plane, at one point, or in space.
TriangleMesh degenerate(test::Rng* rng, int dimensions) {
  TriangleMesh mesh = test::random_soup(rng, 20);
  for (Point& v : mesh.vertices) {
    for (int axis = dimensions; axis < 3; ++axis) v[axis] = 0.05;
  }
  return mesh;
}

std::vector<TriangleMesh> meshes(test::Rng* rng) {
  return {test::box({0.1, 0.2, 0.3}), test::icosphere(0.1, 4),    test::torus(0.08, 0.02, 96, 48),
          test::random_lump(rng),     test::random_soup(rng, 30), degenerate(rng, 0),
          degenerate(rng, 1),         degenerate(rng, 2)};
}

// Some faces and edges are parallel, and some middles in one place.
Eigen::Isometry3d random_pose(test::Rng* rng, int n) {
  Eigen::Isometry3d X = test::random_pose(rng, 0.3);
  if (n % 5 == 0) X.linear().setIdentity();
  if (n % 7 == 0) X.translation().setZero();
  return X;
}

// Never above the distance of any two triangles, from any start; and for convex meshes that
// distance.
TEST(HullDistance, IsALowerBoundAndTightForConvexMeshes) {
  test::Rng rng(32);
  const std::vector<TriangleMesh> all = meshes(&rng);
  constexpr std::size_t kConvex = 2;  // the first ones
  int apart = 0, tight = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    for (std::size_t k = 0; k < all.size(); ++k) {
      const HullCoreset a(parts_of(all[i])), b(parts_of(all[k]));
      const test::TriangleGroups groups_a(test::triangles_of(test::one(all[i])));
      const test::TriangleGroups groups_b(test::triangles_of(test::one(all[k])));
      HullSupport support;
      for (int n = 0; n < test::scaled(30); ++n) {
        const Eigen::Isometry3d X_BA = random_pose(&rng, n);
        const double truth = groups_b.distance(groups_a, X_BA);
        if (n % 3 == 0) support = {};
        const HullDistance found = hull_distance(a, b, X_BA, 1e-9, &support);
        ASSERT_LE(found.lower_bound, truth + 1e-14) << i << " " << k;
        if (!(found.lower_bound > 0.0)) continue;
        ++apart;
        EXPECT_NEAR(found.direction.norm(), 1.0, 1e-12);
        const double width = (found.on_a - found.on_b).norm();
        ASSERT_GE(width, found.lower_bound - 1e-14);
        if (i >= kConvex || k >= kConvex) continue;
        EXPECT_NEAR(width, truth, a.error() + b.error() + 1e-8);
        EXPECT_NEAR(found.lower_bound, truth, 2.0 * (a.error() + b.error()) + 1e-8);
        ++tight;
      }
    }
  }
  EXPECT_GT(apart, test::scaled(500));
  EXPECT_GT(tight, test::scaled(30));
}

TEST(HullDistance, OfSpheresIsThatOfTheirSurfaces) {
  test::Rng rng(33);
  const auto sphere = [&] {
    ConvexPart part;
    part.kind = ConvexPart::Kind::kSphere;
    part.a = test::random_vector(&rng, 1.0);
    part.radius = test::power_of_ten(&rng, -4.0, 0.0);
    return part;
  };
  for (int i = 0; i < 1000; ++i) {
    const ConvexPart a = sphere(), b = sphere();
    const Eigen::Isometry3d X_BA = random_pose(&rng, i);
    const double truth = (X_BA * a.a - b.a).norm() - a.radius - b.radius;
    HullSupport support;
    const double bound =
        hull_distance(HullCoreset({&a, 1}), HullCoreset({&b, 1}), X_BA, 1e-9, &support).lower_bound;
    ASSERT_LE(bound, std::max(truth, 0.0) + 1e-14);
    ASSERT_GE(bound, truth - 1e-8);
  }
}

}  // namespace
}  // namespace ist
