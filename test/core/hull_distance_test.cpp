// Coresets of convex hulls, and lower bounds of the distance of surfaces by them.

#include "internal/geometry/hull_distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "internal/geometry/surface_bvh.h"
#include "support/link_pair_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

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

TEST(HullCoreset, SupportIsThatOfTheSurfaceButForTheError) {
  test::Rng rng(31);
  for (const TriangleMesh& mesh : meshes(&rng)) {
    const HullCoreset hull(parts_of(mesh));
    ASSERT_FALSE(hull.empty());
    EXPECT_LT(hull.error(), 1e-3);
    for (int i = 0; i < test::scaled(2000); ++i) {
      const Point n = test::random_vector(&rng, 1.0).normalized();
      double truth = -1e9;
      for (const Point& v : mesh.vertices) truth = std::max(truth, n.dot(v));
      const double found = n.dot(hull.point(hull.farthest(n)));
      ASSERT_LE(found, truth + 1e-15) << "no point of the surface";
      ASSERT_GE(found + hull.error(), truth);
    }
    for (const Point& v : mesh.vertices) {
      EXPECT_LE(hull.distance_at_most(v), hull.error() + 1e-15);
    }
  }
}

// Cylinders and spheres, alone and together, in any position: their supports are those of the
// points but for the error, also where there are fewer points than were made of them.
TEST(HullCoreset, HoldsRoundPartsToItsError) {
  test::Rng rng(35);
  EXPECT_TRUE(HullCoreset(std::vector<ConvexPart>{}).empty());
  for (const std::size_t max_points : {64, 2048}) {
    for (int trial = 0; trial < test::scaled(20); ++trial) {
      std::vector<ConvexPart> parts;
      for (int i = 0; i <= trial % 3; ++i) {
        ConvexPart part;
        part.kind = (trial + i) % 2 == 0 ? ConvexPart::Kind::kCylinder : ConvexPart::Kind::kSphere;
        part.a = part.c = test::random_vector(&rng, 0.3);
        part.b = test::random_vector(&rng, 0.2);
        part.radius = test::uniform(&rng, 0.001, 0.1);
        if (trial == 4) part.radius = 0.0;
        if (trial == 6) part.b.setZero();
        parts.push_back(part);
      }
      const HullCoreset hull(parts, {}, max_points);
      ASSERT_LE(hull.size(), max_points);
      const bool is_sphere = parts.size() == 1 && parts[0].kind == ConvexPart::Kind::kSphere;
      if (max_points == 2048 && !is_sphere) {
        ASSERT_LT(hull.error(), 0.005 * 0.1);
      }
      for (int i = 0; i < 200; ++i) {
        const Point n = test::random_vector(&rng, 1.0).normalized();
        double truth = -1e9;
        for (const ConvexPart& part : parts) truth = std::max(truth, support(part, n));
        const double found = n.dot(hull.point(hull.farthest(n)));
        ASSERT_LE(found, truth + 1e-12) << trial;
        ASSERT_GE(found + hull.error(), truth) << trial;
        if (is_sphere) {  // as tight as the closed form
          ASSERT_LE(found + hull.error(), truth + 1e-14) << trial;
        }
      }
    }
  }
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
        Eigen::Isometry3d X_BA = test::random_pose(&rng, 0.3);
        if (n % 5 == 0) X_BA.linear().setIdentity();  // parallel faces and edges
        if (n % 7 == 0) X_BA.translation().setZero();
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

TEST(SurfaceBvh, NearestPart) {
  test::Rng rng(33);
  for (const TriangleMesh& mesh : meshes(&rng)) {
    const SurfaceBvh bvh(parts_of(mesh));
    for (int i = 0; i < test::scaled(200); ++i) {
      const Point p = test::random_vector(&rng, 0.4);
      ConvexPart point;
      point.a = point.b = point.c = p;
      point.kind = ConvexPart::Kind::kSphere;
      double truth = 1e9;
      for (const ConvexPart& part : bvh.parts()) {
        truth = std::min(truth, convex_distance(point, part).distance);
      }
      const auto distance_to = [&](SurfaceBvh::Slot slot) {
        return convex_distance(point, bvh.parts()[static_cast<std::size_t>(~bvh.child(slot))])
            .distance;
      };
      EXPECT_EQ(distance_to(bvh.nearest_part(p, 0.0)), truth);
      EXPECT_LE(distance_to(bvh.nearest_part(p, 1.1 * truth)), 1.1 * truth);
    }
  }
}

}  // namespace
}  // namespace ist
