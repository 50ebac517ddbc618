// Lower bounds by supporting planes that are made where they are needed.

#include "proximity/separating_planes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "internal/geometry/float_rounding.h"
#include "internal/geometry/tessellation.h"
#include "internal/proximity/deadline.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

using Points = std::vector<Eigen::Vector3d>;

// Meshes, and their packings to 5 mm.
class SeparatingPlanesTest : public ::testing::Test {
 protected:
  SeparatingPlanesTest() {
    meshes_ = {test::torus(0.1, 0.03, 12, 6), test::l_shape(0.2, 0.05),
               tessellate(Cylinder{0.1, 0.3}, 1e-3).mesh};
    std::vector<Shape> shapes(meshes_.begin(), meshes_.end());
    model_ = test::make_model(shapes, 0.005);
  }

  // [m] By bound_by_planes(). `deadline` as there.
  double bound(std::size_t i, const CloudSnapshot& cloud, const Eigen::Isometry3d& X_FL,
               Deadline* deadline, int max_planes = SeparatingPlanes::kMax) const {
    const LinkModel& link = model_->links[i];
    const PointBvh& bvh = cloud.index.bvh();
    const Eigen::Isometry3d X_OL = bvh.X_FO().inverse() * X_FL;
    const PosedSpheres spheres(link.tree, X_OL, true);
    SeparatingPlanes planes(link, X_OL);
    SeparationInput<PointBvh> input;
    input.spheres = &spheres;
    input.gap = round_up(link.tree.interior_gap() + kError);
    input.radius = static_cast<float>(link.tree.radius());
    input.bvh = &bvh;
    input.max_planes = max_planes;
    return static_cast<double>(bound_by_planes(input, &planes, deadline));
  }

  double truth(std::size_t i, const CloudSnapshot& cloud, const Eigen::Isometry3d& X_FL) const {
    const PointBvh& bvh = cloud.index.bvh();
    const Eigen::Isometry3d X_LO = X_FL.inverse() * bvh.X_FO();
    Points points_L;
    for (std::size_t tile = 0; tile < bvh.tile_count(); ++tile) {
      PointTile scratch;
      const PointTile& points = bvh.tile(tile, &scratch);
      for (int k = 0; k < points.count; ++k) points_L.push_back(X_LO * points.point(k));
    }
    return test::oracle_minimum(meshes_[i], points_L);
  }

  static constexpr double kError = 1e-5;  // [m] of the link's pose in float, a few metres away
  std::vector<TriangleMesh> meshes_;
  std::shared_ptr<RobotModel> model_;
};

// Points on all sides: at some distance from the surface, some of them inside, others 300 m away,
// where a float is 30 um wide.
TEST_F(SeparatingPlanesTest, TheBoundIsNeverAboveTheTruth) {
  test::Rng rng(171);
  int free = 0, inside = 0;
  for (int i = 0; i < test::scaled(900); ++i) {
    const std::size_t link = static_cast<std::size_t>(i) % meshes_.size();
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 1.0);
    const double nearest = std::pow(10.0, test::uniform(&rng, -4.0, -0.5));
    Points points;
    for (int k = 0; k < 1 << (i % 11); ++k) {
      Eigen::Vector3d p = test::random_vector(&rng, 0.3);
      const double distance = test::oracle_signed_distance(meshes_[link], p);
      if (distance < nearest && i % 5 != 0) continue;
      if (i % 7 == 0 && k % 2 == 1) p *= 1000.0;
      points.push_back(X_FL * p);
    }
    if (points.empty()) continue;
    const CloudSnapshot cloud = test::make_snapshot(points);
    const double exact = truth(link, cloud, X_FL);
    Deadline never(0.0), soon(1e-9);
    for (const double found :
         {bound(link, cloud, X_FL, &never), bound(link, cloud, X_FL, &soon),
          bound(link, cloud, X_FL, nullptr), bound(link, cloud, X_FL, &never, 1)}) {
      ASSERT_LE(found, std::max(exact, 0.0) + kError) << "case " << i << ", truth " << exact;
    }
    inside += exact < 0.0 ? 1 : 0;
    free += exact > 0.0 ? 1 : 0;
  }
  EXPECT_GT(inside, test::scaled(50));
  EXPECT_GT(free, test::scaled(100));
}

// Sheets of points 1 to 10 mm from the link, slanted, so that boxes are thick. Spheres alone prove
// few to be free. Planes prove nearly all: those whose tiles are not too many to look into.
TEST_F(SeparatingPlanesTest, SheetsAreSeparated) {
  test::Rng rng(172);
  int cases = 0, by_planes = 0, by_spheres = 0;
  for (int i = 0; i < test::scaled(60); ++i) {
    const std::size_t link = static_cast<std::size_t>(i) % meshes_.size();
    const Eigen::Vector3d n = test::random_vector(&rng, 1.0).normalized();
    const double height = test::uniform(&rng, 0.001, 0.01);
    double support = -std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& v : meshes_[link].vertices) support = std::max(support, n.dot(v));
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 1.0);
    Points points;
    for (int k = 0; k < 3000; ++k) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.4);
      points.push_back(X_FL * (p + (support + height - n.dot(p)) * n));
    }
    const CloudSnapshot cloud = test::make_snapshot(points);
    Deadline never(0.0);
    const double found = bound(link, cloud, X_FL, &never);
    ASSERT_LE(found, truth(link, cloud, X_FL) + kError) << "case " << i;
    ++cases;
    by_planes += found > kError ? 1 : 0;
    by_spheres += bound(link, cloud, X_FL, &never, 0) > kError ? 1 : 0;
  }
  if (test::kSanitized) return;  // too few cases to count
  EXPECT_GT(by_planes, 0.5 * cases);
  EXPECT_GT(by_planes, 1.5 * by_spheres) << by_planes << " and " << by_spheres;
}

// A cylinder in a duct, 20 mm from its wall all around: the spheres reach farther than that. Each
// plane keeps off what is on its own side.
TEST_F(SeparatingPlanesTest, ADuctIsSeparatedBySomePlanes) {
  Points wall;
  for (int ring = 0; ring < 40; ++ring) {
    for (int k = 0; k < 360; ++k) {
      const double angle = M_PI / 180.0 * k;
      wall.emplace_back(0.12 * std::cos(angle), 0.12 * std::sin(angle), -0.2 + 0.01 * ring);
    }
  }
  const CloudSnapshot cloud = test::make_snapshot(wall);
  const Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  const LinkModel& link = model_->links[2];
  const PosedSpheres spheres(link.tree, cloud.index.bvh().X_FO().inverse() * X_FL, true);
  EXPECT_LT(first_bound(spheres, cloud.index.bvh().nodes().data(), cloud.index.bvh().root()), 0.0F)
      << "the scene shows nothing";
  Deadline never(0.0);
  EXPECT_GT(bound(2, cloud, X_FL, &never), 0.0);
  EXPECT_LE(bound(2, cloud, X_FL, &never), truth(2, cloud, X_FL) + kError);
}

// A box 0.1 mm above a plane of points, on a motion without any time: no sphere is so fine. The
// plane across the obstacle that was measured proves that the box is free, at each pose again.
TEST(SeparatingPlanes, ABoxJustAboveAPlaneIsFreeWithoutTime) {
  const auto model = test::make_model({Box{{0.2, 0.2, 0.1}}}, 0.005);
  Points plane;
  for (int i = 0; i < 100; ++i) {
    for (int k = 0; k < 100; ++k) plane.emplace_back(0.01 * i - 0.5, 0.01 * k - 0.5, 0.0);
  }
  const CloudSnapshot cloud = test::make_snapshot(plane);
  QueryConfig config;
  config.deadline = 1e-9;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  for (int step = 0; step < 100; ++step) {
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = Eigen::Vector3d(1e-3 * step, 0.0, 0.0501);
    // What is made late is made, as where no other process takes the processor.
    Deadline::late_for_test = 0.0;
    query.run({X_FL}, {true}, {&cloud}, &results);
    Deadline::late_for_test = -1.0;
    ASSERT_EQ(results[0].state, LinkState::kNear);
    ASSERT_LE(results[0].lower_bound, 1e-4 + 1e-9);
    EXPECT_GT(results[0].lower_bound, 0.0);
  }
}

}  // namespace
}  // namespace ist
