// The bounds of a grid of signed distances, against the link itself.

#include "proximity/signed_distance_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "support/hostile_meshes.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Shape> shapes() {
  return {Box{{0.2, 0.1, 0.3}},          Cylinder{0.05, 0.25},    test::l_shape(0.2, 0.05),
          test::torus(0.1, 0.03, 12, 6), test::icosphere(0.1, 3), test::open_box({0.15, 0.1, 0.2}),
          test::thin_plate(0.2, 0.004)};
}

// How often the bounds were worth something.
struct Counts {
  int outside = 0, sides = 0, close = 0, close_depth = 0, close_below_plane = 0;
};

// All that a cell says of a place, against the truth.
void expect_bounds(const LinkModel& link, SignedDistanceGrid* grid, const Eigen::Vector3d& p_L,
                   Counts* counts) {
  SignedDistanceGrid::Cell* cell = grid->measure(p_L);
  ASSERT_NE(cell, nullptr);
  const SignedDistanceGrid::Bound bound = grid->bound(cell, {p_L}, kInfinity);
  const PointDepth truth = point_depth(link.solid, p_L, -1.0);
  const double signed_distance = truth.exact.distance;
  ASSERT_LE(bound.signed_distance, signed_distance);
  ASSERT_LE(grid->floor_bound(*cell, p_L, 0.0), truth.floor);
  if (signed_distance > 0.0) ASSERT_LE(bound.surface_distance, signed_distance);
  if (bound.is_outside) ASSERT_GE(signed_distance, 0.0);
  ASSERT_LE(grid->depth_bound(*cell, {p_L}), signed_distance);
  counts->outside += bound.is_outside ? 1 : 0;
  counts->close += signed_distance > 0.0 && bound.surface_distance > signed_distance - 1e-3 ? 1 : 0;
  counts->close_below_plane +=
      signed_distance < 0.0 && bound.signed_distance > 1.5 * signed_distance ? 1 : 0;
  if (!is_one_mesh(link.solid)) return;
  ASSERT_LE(bound.surface_distance, std::abs(signed_distance));
  counts->close_depth +=
      signed_distance < 0.0 && grid->depth_bound(*cell, {p_L}) > signed_distance - 1e-3 ? 1 : 0;
  const NearSurface near = grid->near_surface(cell, p_L);
  ASSERT_GE(near.within, std::abs(signed_distance));
  if (near.side != NearSurface::Side::kUnknown) {
    ASSERT_EQ(near.side == NearSurface::Side::kInside, signed_distance < 0.0);
    ++counts->sides;
  }
  // Hints do not change the depth.
  const PointDepth hinted = point_depth(link.solid, p_L, -1.0, near);
  ASSERT_EQ(hinted.exact.distance, signed_distance);
  ASSERT_EQ(hinted.floor, truth.floor);
}

TEST(SignedDistanceGrid, IsNeverAboveTheTruth) {
  const test::Trial trial(shapes(), 0.005);
  test::Rng rng(93);
  for (const LinkModel& link : trial.model().links) {
    SCOPED_TRACE(link.name);
    SignedDistanceGrid grid(link);
    Counts counts;
    Eigen::Vector3d p = Eigen::Vector3d::Zero();
    for (int i = 0; i < 8000; ++i) {
      // Most points are near the last one, and some are far from the link.
      if (i % 4 == 0) {
        p = link.tree.center() +
            test::random_vector(&rng, i % 40 == 0 ? 5.0 : 0.7 * link.tree.radius());
      } else {
        p += test::random_vector(&rng, 2e-4);
      }
      ASSERT_NO_FATAL_FAILURE(expect_bounds(link, &grid, p, &counts));
    }
    EXPECT_GT(counts.close, 300);
    EXPECT_EQ(counts.outside > 300, link.solid.is_closed());
    if (link.solid.is_closed()) EXPECT_GT(counts.close_below_plane, 10);
    if (is_one_mesh(link.solid)) {
      EXPECT_EQ(counts.sides > 300, link.solid.is_closed());
      EXPECT_GT(counts.close_depth, 30);
    }
  }
}

// Points that are a little above a surface, near its edges too: where signs and planes may fail.
TEST(SignedDistanceGrid, HoldsNearTheSurface) {
  const test::Trial trial(shapes(), 0.005);
  test::Rng rng(94);
  for (const LinkModel& link : trial.model().links) {
    SCOPED_TRACE(link.name);
    SignedDistanceGrid grid(link);
    Counts counts;
    for (int i = 0; i < 4000; ++i) {
      const Eigen::Vector3d p = link.tree.center() + test::random_vector(&rng, link.tree.radius());
      const SignedDistance from = link.solid.signed_distance(p);
      const double height =
          std::pow(10.0, -1.0 - 8.0 * (i % 100) / 100.0) * (i % 2 == 0 ? 0.1 : -0.1);
      ASSERT_NO_FATAL_FAILURE(
          expect_bounds(link, &grid, from.witness + height * from.normal, &counts));
    }
  }
}

// Two blocks with a slot between them; half of a face of one is missing, away from the slot.
TriangleMesh slotted_block() {
  const TriangleMesh block = test::box({0.1, 0.1, 0.04});
  TriangleMesh open = block;
  open.triangles.erase(open.triangles.begin() + 2);
  return test::joined(block,
                      test::moved(open, Eigen::Isometry3d(Eigen::Translation3d(0.0, 0.0, 0.044))));
}

// A mesh with holes: no place within the margin is inside, also in a sphere with an opening, whose
// winding number changes slowly there; and whatever cell says so, also from beyond a wall.
TEST(SignedDistanceGrid, PlacesWithinTheMarginAreOutside) {
  TriangleMesh bowl = test::icosphere(0.1, 3);
  bowl.triangles.resize(bowl.triangles.size() - bowl.triangles.size() / 8);
  const test::Trial trial({test::open_box({0.15, 0.1, 0.2}), bowl, slotted_block()}, 0.005);
  test::Rng rng(96);
  for (const LinkModel& link : trial.model().links) {
    SCOPED_TRACE(link.name);
    SignedDistanceGrid grid(link);
    int margins = 0;
    for (int i = 0; i < 4000; ++i) {
      const Eigen::Vector3d p = link.tree.center() + test::random_vector(&rng, link.tree.radius());
      const double margin = grid.outside_margin(grid.measure(p), {p});
      if (!(margin > 0.0)) continue;
      ++margins;
      for (int k = 0; k < 4; ++k) {
        const Eigen::Vector3d place = p + margin * test::random_vector(&rng, 1.0).normalized();
        ASSERT_FALSE(link.solid.is_inside(place)) << margin;
      }
    }
    EXPECT_GT(margins, 300);
    int of_others = 0;
    for (int i = 0; i < test::scaled(40000); ++i) {
      SignedDistanceGrid::Part part;
      part.center_L = link.tree.center() + test::random_vector(&rng, link.tree.radius());
      part.radius = i % 2 == 0 ? 0.0 : test::uniform(&rng, 0.0, 0.005);
      const double margin =
          grid.outside_margin(grid.measure(part.center_L + test::random_vector(&rng, 0.008)), part);
      if (!(margin > 0.0)) continue;
      ++of_others;
      for (int k = 0; k < 4; ++k) {
        const Eigen::Vector3d direction = test::random_vector(&rng, 1.0).normalized();
        ASSERT_FALSE(link.solid.is_inside(part.center_L + (part.radius + margin) * direction))
            << margin << " at " << part.center_L.transpose();
      }
    }
    EXPECT_GT(of_others, test::scaled(500));
  }
}

// Bounds by measured neighbours do not change what a cell holds.
TEST(SignedDistanceGrid, NeighborsAffectTheSpeedAlone) {
  const test::Trial trial(shapes(), 0.005);
  test::Rng rng(97);
  for (const LinkModel& link : trial.model().links) {
    SCOPED_TRACE(link.name);
    SignedDistanceGrid many(link);
    for (int i = 0; i < 3000; ++i) {
      const Eigen::Vector3d p = link.tree.center() + test::random_vector(&rng, link.tree.radius());
      SignedDistanceGrid alone(link);
      const SignedDistanceGrid::Cell& one = *alone.measure(p);
      const SignedDistanceGrid::Cell& other = *many.measure(p);
      ASSERT_EQ(other.floor, one.floor);
      // Of several triangles that are equally near, either may be the closest.
      if (other.triangle == one.triangle) ASSERT_EQ(other.normal, one.normal);
    }
  }
}

// The bound of a sphere, of a box and of the points of a tile holds for each of their places.
TEST(SignedDistanceGrid, BoundsPartsOfSpace) {
  const test::Trial trial(shapes(), 0.005);
  test::Rng rng(95);
  int outside = 0, close_depth = 0;
  for (const LinkModel& link : trial.model().links) {
    SCOPED_TRACE(link.name);
    SignedDistanceGrid grid(link);
    for (int i = 0; i < 3000; ++i) {
      const Eigen::Isometry3d X_LO = test::random_pose(&rng, 0.1);
      const Eigen::Matrix3d R_LO = X_LO.linear();
      SignedDistanceGrid::Part part;
      part.center_L = link.tree.center() + test::random_vector(&rng, 0.7 * link.tree.radius());
      part.half = test::random_vector(&rng, 0.3 * grid.plane_radius()).cwiseAbs();
      part.radius = part.half.norm();
      part.R_LO = &R_LO;
      part.center_O = X_LO.inverse() * part.center_L;
      PointTile tile{};
      for (tile.count = 0; tile.count < 1 + i % kPointWidth; ++tile.count) {
        const Eigen::Vector3d p_O =
            part.center_O + 0.99 * part.half.cwiseProduct(test::random_vector(&rng, 1.0));
        tile.x[tile.count] = static_cast<float>(p_O.x());
        tile.y[tile.count] = static_cast<float>(p_O.y());
        tile.z[tile.count] = static_cast<float>(p_O.z());
      }
      if (i % 2 == 0) part.points = &tile;
      SignedDistanceGrid::Cell* cell = grid.measure(part.center_L);
      const SignedDistanceGrid::Bound bound = grid.bound(cell, part, kInfinity);
      outside += bound.is_outside ? 1 : 0;
      const double depth = grid.depth_bound(*cell, part);
      double deepest = 0.0;
      for (int k = 0; k < tile.count; ++k) {
        const double truth = link.solid.signed_distance(X_LO * tile.point(k)).distance;
        ASSERT_LE(depth, truth + (i % 2 == 0 ? 1e-12 : 1e-7));
        deepest = std::min(deepest, truth);
        // A float point of the tile may be a little outside its box.
        ASSERT_LE(bound.signed_distance, truth + (i % 2 == 0 ? 1e-12 : 1e-7));
        if (bound.is_outside) ASSERT_GE(truth, 0.0);
        if (truth > 0.0) ASSERT_LE(bound.surface_distance, truth + (i % 2 == 0 ? 1e-12 : 1e-7));
      }
      // Better than the distance of the centre and the radius of the part.
      const double by_center = grid.depth_bound(*cell, {part.center_L}) - part.radius;
      close_depth += deepest < 0.0 && depth > 0.5 * (deepest + by_center) ? 1 : 0;
    }
  }
  EXPECT_GT(outside, 2000);
  EXPECT_GT(close_depth, 500);
}

// A cell's plane holds within its radius: a part that is longer may meet a wall that the cell does
// not know. Above the plane may be the inside: where a slot is narrow, that of its other side.
TEST(SignedDistanceGrid, BoundsLongPartsInCornersAndSlots) {
  TriangleMesh slot = test::shifted(test::box({0.2, 0.2, 0.1}), {0, 0, 0.051});
  slot = test::joined(slot, test::shifted(test::box({0.2, 0.2, 0.03}), {0, 0, -0.016}));
  TriangleMesh comb = test::box({0.3, 0.1, 0.02});  // fins of 5 mm, 35 mm apart
  for (int i = -3; i <= 3; ++i) {
    comb = test::joined(comb, test::shifted(test::box({0.005, 0.1, 0.06}), {0.04 * i, 0, 0.041}));
  }
  const test::Trial trial({test::l_shape(0.2, 0.05), slot, comb}, 0.005);
  test::Rng rng(96);
  for (const LinkModel& link : trial.model().links) {
    SCOPED_TRACE(link.name);
    SignedDistanceGrid grid(link);
    const Eigen::Matrix3d R_LO = Eigen::Matrix3d::Identity();
    int outside = 0, at_walls = 0;
    for (int i = 0; i < test::scaled(20000); ++i) {
      const Eigen::Vector3d p = link.tree.center() + test::random_vector(&rng, link.tree.radius());
      const SignedDistance from = link.solid.signed_distance(p);
      SignedDistanceGrid::Part part;
      const double height = test::uniform(&rng, -0.5, 1.0) * grid.plane_radius();
      part.center_L = part.center_O = from.witness + height * from.normal;
      for (int axis = 0; axis < 3; ++axis) {
        part.half[axis] = grid.plane_radius() * std::pow(10.0, test::uniform(&rng, -3.0, 0.4));
      }
      part.radius = part.half.norm();
      part.R_LO = &R_LO;
      SignedDistanceGrid::Cell* cell = grid.measure(part.center_L);
      const SignedDistanceGrid::Bound bound = grid.bound(cell, part, kInfinity);
      outside += bound.is_outside ? 1 : 0;
      for (int k = 0; k < 27; ++k) {
        const Eigen::Vector3d corner(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
        const double truth =
            link.solid.signed_distance(part.center_L + part.half.cwiseProduct(corner)).distance;
        ASSERT_LE(bound.signed_distance, truth) << "part " << i;
        ASSERT_LE(bound.surface_distance, std::abs(truth)) << "part " << i;
        if (bound.is_outside) ASSERT_GE(truth, 0.0) << "part " << i;
        at_walls += std::abs(truth) < 1e-3 ? 1 : 0;
      }
    }
    EXPECT_GT(outside, test::scaled(100));
    EXPECT_GT(at_walls, test::scaled(1000));
  }
}

// A bound is the same before and after its cell is measured. A place that is not finite, or very
// far from the link, has no cell.
TEST(SignedDistanceGrid, HoldsOnlyMeasuredCells) {
  const test::Trial trial(shapes(), 0.005);
  const LinkModel& link = trial.model().links[2];
  SignedDistanceGrid grid(link);
  const Eigen::Vector3d p = link.tree.center();
  EXPECT_EQ(grid.find(p), nullptr);
  SignedDistanceGrid::Cell* cell = grid.measure(p);
  ASSERT_NE(cell, nullptr);
  EXPECT_EQ(grid.find(p), cell);
  EXPECT_EQ(grid.find(p + Eigen::Vector3d(10, 0, 0)), nullptr);
  EXPECT_EQ(grid.measure(p + Eigen::Vector3d(1e9, 0, 0)), nullptr);
  const double none = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(grid.find({none, 0, 0}), nullptr);
  EXPECT_EQ(grid.measure({0, none, 0}), nullptr);
  EXPECT_EQ(grid.measure({0, 0, kInfinity}), nullptr);
}

}  // namespace
}  // namespace ist
