// Places near a point outside a mesh with holes: as far as the margin says, none is inside.

#include "internal/geometry/outside_margin.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "geometry/open_edge_blocks.h"
#include "internal/geometry/solid_queries.h"
#include "support/meshes.h"
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
