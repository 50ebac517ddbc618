// The lower bounds of a grid of signed distances, against the link itself.

#include "proximity/signed_distance_grid.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "support/meshes.h"
#include "support/trial.h"

namespace ist {
namespace {

std::vector<Shape> shapes() {
  return {Box{{0.2, 0.1, 0.3}},
          Cylinder{0.05, 0.25},
          test::l_shape(0.2, 0.05),
          test::torus(0.1, 0.03, 12, 6),
          test::open_box({0.15, 0.1, 0.2}),
          test::thin_plate(0.2, 0.004)};
}

TEST(SignedDistanceGrid, IsNeverAboveTheTruth) {
  const test::Trial trial(shapes(), 0.005);
  test::Rng rng(93);
  for (const LinkModel& link : trial.model().links) {
    SignedDistanceGrid grid(link);
    int known = 0, sides = 0, close = 0;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (int i = 0; i < 6000; ++i) {
      // Most points are near the last one, and some are far from the link.
      if (i % 4 == 0) {
        p = link.tree.center() +
            test::random_vector(&rng, i % 40 == 0 ? 5.0 : 0.5 * link.tree.radius());
      } else {
        p += test::random_vector(&rng, 2e-4);
      }
      SignedDistanceGrid::Sample found;
      known += grid.find(p, &found) ? 1 : 0;
      found = grid.measure(p);
      const PointDepth truth = point_depth(link.solid, p, -1.0);
      ASSERT_LE(found.lower_bound, truth.floor + 1e-12);
      ASSERT_LE(found.lower_bound, truth.exact.distance + 1e-12);
      close += found.lower_bound > truth.floor - 0.02 ? 1 : 0;
      if (!is_one_mesh(link.solid)) continue;
      ASSERT_GE(found.near.within, std::abs(truth.exact.distance) - 1e-12);
      const bool is_inside = truth.exact.distance < 0.0;
      if (found.near.side != NearSurface::Side::kUnknown) {
        ASSERT_EQ(found.near.side == NearSurface::Side::kInside, is_inside);
        ++sides;
      }
      // The hint from the grid does not change the depth.
      const PointDepth hinted = point_depth(link.solid, p, -1.0, found.near);
      ASSERT_EQ(hinted.exact.distance, truth.exact.distance);
      ASSERT_EQ(hinted.floor, truth.floor);
    }
    EXPECT_GT(known, 300);
    EXPECT_GT(close, 1000);
    if (is_one_mesh(link.solid)) EXPECT_EQ(sides > 0, link.solid.is_closed());
  }
}

// A sample is the same before and after its cell is measured. A point that is not finite has no
// cell.
TEST(SignedDistanceGrid, HoldsOnlyMeasuredCells) {
  const test::Trial trial(shapes(), 0.005);
  const LinkModel& link = trial.model().links[2];
  SignedDistanceGrid grid(link);
  const Eigen::Vector3d p = link.tree.center();
  SignedDistanceGrid::Sample found;
  EXPECT_FALSE(grid.find(p, &found));
  const double measured = grid.measure(p).lower_bound;
  ASSERT_TRUE(grid.find(p, &found));
  EXPECT_EQ(found.lower_bound, measured);
  EXPECT_FALSE(grid.find(p + Eigen::Vector3d(10, 0, 0), &found));
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(grid.find({none, 0, 0}, &found));
  EXPECT_TRUE(std::isnan(grid.measure({0, none, 0}).lower_bound));
}

}  // namespace
}  // namespace ist
