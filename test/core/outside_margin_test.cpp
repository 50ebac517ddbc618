// Places near a point outside a mesh with holes: as far as the margin says, none is inside.

#include "internal/geometry/outside_margin.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "geometry/open_edge_blocks.h"
#include "internal/geometry/solid_queries.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

// A sphere of triangles, of which every n-th is missing.
TriangleMesh perforated(int n) {
  TriangleMesh mesh = test::icosphere(0.1, 3);
  std::vector<TriangleMesh::Triangle> kept;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % static_cast<std::size_t>(n) != 0) kept.push_back(mesh.triangles[t]);
  }
  mesh.triangles = kept;
  return mesh;
}

TEST(OutsideMargin, HoldsNoPlaceInside) {
  test::Rng rng(181);
  int positive = 0, large = 0;
  for (const TriangleMesh& mesh :
       {test::open_box({0.15, 0.1, 0.2}), perforated(3), perforated(10), perforated(1000)}) {
    const Solid solid({GeometryElement{mesh, Eigen::Isometry3d::Identity(), "test"}});
    ASSERT_FALSE(solid.is_closed());
    for (int i = 0; i < test::scaled(3000); ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, i % 2 == 0 ? 0.15 : 0.11);
      const double distance = std::abs(solid.signed_distance(p).distance);
      const OutsideMargin found = outside_margin(solid, p, distance);
      ASSERT_EQ(found.is_inside, solid.is_inside(p));
      ASSERT_LE(found.margin, distance);
      if (!(found.margin > 0.0)) continue;
      ASSERT_FALSE(found.is_inside);
      ++positive;
      large += found.margin > 1e-3 ? 1 : 0;
      for (int k = 0; k < 10; ++k) {
        const Eigen::Vector3d offset = found.margin *
                                       (k % 2 == 0 ? 1.0 : std::sqrt(test::uniform(&rng, 0, 1))) *
                                       test::random_vector(&rng, 1.0).normalized();
        ASSERT_FALSE(solid.is_inside(p + offset)) << p.transpose() << ", " << offset.norm();
      }
    }
  }
  EXPECT_GT(positive, test::scaled(2000));
  EXPECT_GT(large, test::scaled(1000));
}

// Next to an edge of many short pieces the bound is no more than pi / 2 times the gradient: an edge
// seen from `d` changes the winding number by 1 / (2 pi d) for each metre.
TEST(OutsideMargin, GradientIsBounded) {
  TriangleMesh fan;  // a square, its border in short edges
  constexpr int kPieces = 100;
  fan.vertices.push_back(Eigen::Vector3d::Zero());
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < kPieces; ++i) {
      const double along = 2.0 * i / kPieces - 1.0;
      const Eigen::Vector3d p(1.0, along, 0.0);
      fan.vertices.push_back(Eigen::AngleAxisd(0.5 * EIGEN_PI * side, Eigen::Vector3d::UnitZ()) *
                             p);
    }
  }
  for (std::uint32_t i = 0; i < 4 * kPieces; ++i) {
    fan.triangles.push_back({0, 1 + i, 1 + (i + 1) % (4 * kPieces)});
  }
  const OpenEdgeBlocks edges(fan);
  test::Rng rng(182);
  double least = 10.0;
  for (int i = 0; i < test::scaled(300); ++i) {
    const double from_edge = test::uniform(&rng, 0.05, 0.4);
    const double angle = test::uniform(&rng, 0.0, 2.0 * EIGEN_PI);
    const Eigen::Vector3d p(1.0 + from_edge * std::cos(angle), test::uniform(&rng, -0.7, 0.7),
                            from_edge * std::sin(angle));
    Eigen::Vector3d gradient;
    constexpr double kStep = 1e-4;
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(axis);
      // Past the square itself the winding number jumps by one.
      const double change =
          test::oracle_winding(fan, p + step) - test::oracle_winding(fan, p - step);
      gradient[axis] = (change - std::round(change)) / (2.0 * kStep);
    }
    const double bound = edges.gradient_bound(p, 0.0);
    ASSERT_LE(gradient.norm(), bound * (1.0 + 1e-5)) << p.transpose();
    least = std::min(least, bound / gradient.norm());
    // And within a ball, wherever the place is.
    const double radius = 0.5 * from_edge;
    ASSERT_LE(edges.gradient_bound(p + radius * test::random_vector(&rng, 0.5), 0.0),
              edges.gradient_bound(p, radius));
  }
  EXPECT_LT(least, 2.0) << "a bound ten times as low would not hold";
}

// The edges of a large mesh take a second to collect, which nothing could end.
TEST(OutsideMargin, EdgesCanBeCancelled) {
  const TriangleMesh mesh = perforated(3);
  int calls = 0;
  const OpenEdgeBlocks whole(mesh, [&] { return ++calls < 0; });
  ASSERT_GT(calls, 1);
  for (const int last : {1, calls}) {
    int asked = 0;
    EXPECT_THROW(OpenEdgeBlocks(mesh, [&] { return ++asked >= last; }), Cancelled);
    EXPECT_EQ(asked, last);
  }
  const double far = whole.gradient_bound({1.0, 0.0, 0.0}, 0.0);
  EXPECT_EQ(far, OpenEdgeBlocks(mesh).gradient_bound({1.0, 0.0, 0.0}, 0.0));
}

}  // namespace
}  // namespace ist
