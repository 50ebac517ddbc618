// Every instruction set of this machine gives the same answers.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "internal/geometry/triangle_bvh.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "support/box_oracle.h"
#include "support/instruction_sets.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

TEST(InstructionSets, SameGeometry) {
  test::Rng rng(81);
  const TriangleMesh mesh = test::torus(0.1, 0.03, 24, 12);
  const TriangleBvh bvh(mesh);
  for (int i = 0; i < test::scaled(2000); ++i) {
    const Eigen::Vector3d p = test::random_vector(&rng, i % 2 == 0 ? 0.15 : 1.0);
    const double distance = test::oracle_distance(mesh, p), w = test::oracle_winding(mesh, p);
    test::for_each_instruction_set([&] {
      ASSERT_NEAR(std::sqrt(bvh.closest(p).distance_sq), distance, 1e-12);
      ASSERT_NEAR(bvh.winding_number(p), w, 0.01);
      ASSERT_NEAR(bvh.quick_winding_number(p), w, TriangleBvh::kQuickWindingError);
    });
  }
}

// Expects the answer of another instruction set, up to the rounding of float.
void expect_same(const LinkProximity& result, const LinkProximity& first, double tolerance,
                 const Eigen::Isometry3d& X_FL) {
  if (std::abs(first.distance) > 2e-8 + tolerance) ASSERT_EQ(result.state, first.state);
  if (first.state == LinkState::kClear) return;
  // Float decides on which side of a mesh a point at its surface is.
  ASSERT_NEAR(result.distance, first.distance, tolerance + 4e-8);
  test::expect_witness(result, X_FL);
}

// Runs the same query with each instruction set; `results` are the last one's.
void expect_same_answers(const std::shared_ptr<const RobotModel>& model, const QueryConfig& config,
                         const std::vector<Eigen::Isometry3d>& X_FL, const CloudSnapshot& cloud,
                         std::vector<LinkProximity>* results) {
  const std::vector<bool> known(X_FL.size(), true);
  std::vector<LinkProximity> first;
  int sets = 0;
  test::for_each_instruction_set([&] {
    ++sets;
    ASSERT_TRUE(ProximityQuery(model, config).run(X_FL, known, {&cloud}, results));
    if (first.empty()) first = *results;
    for (std::size_t i = 0; i < X_FL.size(); ++i) {
      SCOPED_TRACE("link " + std::to_string(i));
      ASSERT_NO_FATAL_FAILURE(expect_same((*results)[i], first[i], config.tolerance, X_FL[i]));
    }
  });
  EXPECT_GT(sets, 1);
}

TEST(InstructionSets, SameAnswers) {
  test::Rng rng(82);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.01);
  for (int scene = 0; scene < test::scaled(100); ++scene) {
    const std::vector<Eigen::Vector3d> points = test::random_points(
        &rng, links[static_cast<std::size_t>(scene) % links.size()], 1 + scene % 100);
    const CloudSnapshot cloud = test::make_snapshot(points);
    const std::vector<Eigen::Isometry3d> X_FL(links.size(), test::random_pose(&rng, 0.1));
    for (const double tolerance : {0.0, 0.001}) {
      QueryConfig config;
      config.tolerance = tolerance;
      std::vector<LinkProximity> results;
      ASSERT_NO_FATAL_FAILURE(expect_same_answers(model, config, X_FL, cloud, &results));
      if (scene % 10 != 0) continue;
      for (std::size_t i = 0; i < links.size(); ++i) {
        test::expect_truth(results[i], test::truth_of(links[i], X_FL[i], points, cloud), config,
                           X_FL[i]);
      }
    }
  }
}

TEST(InstructionSets, SameDistancesToBoxes) {
  test::Rng rng(83);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.01);
  const std::vector<bool> known(links.size(), true);
  QueryConfig config;
  config.tolerance = 0.0;
  int near = 0;
  for (int scene = 0; scene < test::scaled(100); ++scene) {
    const auto boxes = test::random_leaves(&rng, 1 + scene, 0.8, 0.02, 4);
    const CloudSnapshot map = test::make_map(boxes, test::random_pose(&rng, 0.2));
    const std::vector<Eigen::Isometry3d> X_FL(links.size(), test::random_pose(&rng, 0.3));
    std::vector<LinkProximity> first, results;
    test::for_each_instruction_set([&] {
      ASSERT_TRUE(ProximityQuery(model, config).run(X_FL, known, {&map}, &results));
      if (first.empty()) first = results;
      for (std::size_t i = 0; i < links.size(); ++i) {
        ASSERT_EQ(results[i].state, first[i].state);
        if (first[i].state != LinkState::kNear) continue;  // any depth within the bounds is right
        ASSERT_NEAR(results[i].distance, first[i].distance, 4e-8);
        ++near;
      }
    });
  }
  EXPECT_GT(near, 10);
}

TEST(InstructionSets, SameRepulsion) {
  test::Rng rng(84);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.01);
  const Repulsion repulsion(model);
  LinkProximity proximity;
  proximity.state = LinkState::kNear;
  proximity.distance = 0.1;
  proximity.direction = Eigen::Vector3d::UnitX();
  for (int scene = 0; scene < test::scaled(100); ++scene) {
    CloudSnapshot cloud;
    if (scene % 2 == 0) {
      std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(1 + 10 * scene));
      for (Eigen::Vector3d& p : points) p = test::random_vector(&rng, 0.3);
      cloud = test::make_snapshot(points);
      cloud.index.bvh().set_thinning(cloud.thinning);
    } else {
      const auto boxes = test::random_leaves(&rng, 1 + scene, 0.8, 0.02, 4);
      cloud = test::make_map(boxes, test::random_pose(&rng, 0.2));
    }
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.3);
    for (std::size_t i = 0; i < links.size(); ++i) {
      const RepulsiveWrench first = repulsion.wrench(i, X_FL, {&cloud}, proximity, {});
      ASSERT_TRUE(first.force.allFinite());
      test::for_each_instruction_set([&] {
        const RepulsiveWrench push = repulsion.wrench(i, X_FL, {&cloud}, proximity, {});
        ASSERT_LT((push.force - first.force).norm(), 1e-4);
        ASSERT_LT((push.torque - first.torque).norm(), 1e-4);
      });
    }
  }
}

}  // namespace
}  // namespace ist
