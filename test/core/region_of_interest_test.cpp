// The region of interest: points outside are discarded, and answers account for what is unknown
// there.

#include "ist_proximity/robot/link_poses.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_robots.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRounding = 1e-6;  // [m]

// A sphere for each of the links l0, l1 ...
std::shared_ptr<RobotModel> spheres(std::size_t count, double radius) {
  const auto model = test::make_model(std::vector<Shape>(count, Sphere{radius}), 0.01);
  for (std::size_t i = 0; i < count; ++i) model->links[i].name = "l" + std::to_string(i);
  return model;
}

// A sphere for each of a random robot's links.
struct Arm {
  Arm(test::Rng* rng, int max_joints) : description(test::random_robot(rng, max_joints)) {
    for (JointDescription& joint : description.joints) {
      joint.lower = test::uniform(rng, -1.0, 0.0);
      joint.upper = test::uniform(rng, 0.0, 1.0);
    }
    model = spheres(description.joints.size() + 1, 0.05);
  }

  RobotDescription description;
  std::shared_ptr<RobotModel> model;
};

TEST(KinematicReach, BoundsEveryLinkInEveryConfiguration) {
  test::Rng rng(5);
  for (int k = 0; k < test::scaled(60); ++k) {
    const Arm arm(&rng, 6);
    const Kinematics kinematics(arm.description);
    const double far = kinematic_reach(*arm.model, kinematics);
    double farthest = 0.0;
    for (int i = 0; i < 200; ++i) {
      std::vector<double> q;
      for (const Kinematics::Joint& joint : kinematics.joints()) {
        const bool slides = joint.type == JointType::kPrismatic;
        const bool is_source = std::any_of(
            kinematics.joints().begin(), kinematics.joints().end(), [&](const auto& other) {
              return other.type == JointType::kPrismatic && other.source == q.size();
            });
        q.push_back(slides || is_source ? test::uniform(&rng, joint.lower, joint.upper)
                                        : test::uniform(&rng, -4.0, 4.0));
      }
      JointPoses poses;
      kinematics.place_joints(q, &poses);
      BodyPoses bodies;
      kinematics.place_bodies(poses, Eigen::Isometry3d::Identity(), &bodies);
      for (const Eigen::Isometry3d& X : bodies.X_FB) {
        farthest = std::max(farthest, X.translation().norm() + 0.05);
      }
    }
    ASSERT_LE(farthest, far + 1e-9);
  }
}

TEST(KinematicReach, OfAStretchedArm) {
  RobotDescription arm;
  arm.root_link = "l0";
  arm.joints = {test::joint("to_l1", JointType::kRevolute, "l0", "l1", {0.0, 0.0, 0.3}),
                test::joint("to_l2", JointType::kPrismatic, "l1", "l2", {0.5, 0.0, 0.0})};
  arm.joints[1].lower = -0.4;
  arm.joints[1].upper = 0.2;
  const auto model = spheres(3, 0.1);
  EXPECT_NEAR(kinematic_reach(*model, Kinematics(arm)), 0.3 + 0.5 + 0.4 + 0.1, 0.02);
  arm.joints[1].upper = kInfinity;
  EXPECT_EQ(kinematic_reach(*model, Kinematics(arm)), kInfinity);
  arm.joints[1].upper = 0.2;
  arm.joints[0].type = JointType::kFloating;
  EXPECT_EQ(kinematic_reach(*model, Kinematics(arm)), kInfinity);
}

// The root stands still in the frames that are fixed to it, and in no others.
TEST(RegionOfInterest, ExistsOnlyInFramesFixedToTheRoot) {
  RobotDescription robot;
  robot.root_link = "world";
  robot.joints = {test::joint("to_l0", JointType::kFixed, "world", "l0", {1.0, 2.0, 3.0}),
                  test::joint("to_l1", JointType::kRevolute, "l0", "l1")};
  const auto model = spheres(2, 0.1);
  const Kinematics kinematics(robot);
  const double far = kinematic_reach(*model, kinematics);
  for (const char* frame : {"l1", "map", ""}) {
    EXPECT_EQ(region_of_interest(*model, kinematics, frame, 0.5).radius, kInfinity) << frame;
  }
  const RegionOfInterest at_root = region_of_interest(*model, kinematics, "world", 0.5);
  EXPECT_EQ(at_root.center_F, Eigen::Vector3d::Zero());
  EXPECT_NEAR(at_root.radius, far + 0.5, 0.01);
  EXPECT_GE(at_root.radius, far + 0.5);
  const RegionOfInterest at_base = region_of_interest(*model, kinematics, "l0", 0.5);
  EXPECT_EQ(at_base.center_F, Eigen::Vector3d(-1.0, -2.0, -3.0));
  EXPECT_EQ(at_base.radius, at_root.radius);
}

// All points of a scene, and the cloud of those that are in its region of interest.
struct CroppedScene {
  std::vector<Eigen::Vector3d> points;  ///< [m] in the fixed frame
  CloudSnapshot cloud;
};

CroppedScene random_cropped_scene(test::Rng* rng) {
  CroppedScene scene;
  RegionOfInterest region;
  region.center_F = test::random_vector(rng, 0.2);
  region.radius = 1.0;
  std::vector<Eigen::Vector3d> kept;
  for (int i = 0; i < 60; ++i) {
    const Eigen::Vector3d p = test::random_vector(rng, 1.2);
    scene.points.push_back(p);
    if ((p - region.center_F).norm() <= region.radius) kept.push_back(p);
  }
  scene.cloud = test::make_snapshot(kept);
  scene.cloud.region = region;
  return scene;
}

// Whether all points within max_distance of a link are in the region.
bool is_inside(const InnerSphereTree& tree, const Eigen::Isometry3d& X_FL,
               const RegionOfInterest& region, double max_distance) {
  const double from_center = (X_FL * tree.center() - region.center_F).norm();
  return from_center + tree.radius() + max_distance <= region.radius;
}

bool is_measured(const LinkProximity& link) { return link.state >= LinkState::kNear; }

// Expects bounds that hold for the discarded points, too.
// @param truth   [m] distance to the nearest of all points
// @param inside  whether all points within max_distance of the link are in the region
void expect_bounds(const LinkProximity& link, double truth, bool inside,
                   const QueryConfig& config) {
  ASSERT_LE(link.lower_bound, truth);
  if (link.state == LinkState::kClear) ASSERT_GE(truth, config.max_distance - kRounding);
  if (inside) ASSERT_NE(link.state, LinkState::kUnknown);
  if (is_measured(link)) ASSERT_GE(link.distance, truth - kRounding);
}

// Links are near the region's border. Bounds must hold for all points, also for the discarded ones.
TEST(RegionOfInterest, BoundsHoldForDiscardedPoints) {
  test::Rng rng(17);
  const std::vector<TriangleMesh> meshes = {test::l_shape(0.2, 0.05), test::icosphere(0.08, 2)};
  const auto model = test::make_model({meshes.begin(), meshes.end()}, 0.005);
  QueryConfig config;
  config.max_distance = 0.3;
  ProximityQuery query(model, config);
  const std::vector<bool> known(meshes.size(), true);
  int clear = 0, measured = 0, unknown = 0, cut = 0;
  for (int k = 0; k < (test::kSanitized ? 20 : 40); ++k) {
    const auto [points, cloud] = random_cropped_scene(&rng);
    std::vector<Eigen::Isometry3d> X_FL;
    double least = kInfinity;
    bool all_inside = true;
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      X_FL.push_back(test::random_pose(&rng, 0.8));
      const double truth = test::oracle_minimum(test::one(meshes[i]), X_FL[i], points);
      least = std::min(least, truth);
      LinkProximity link;
      ASSERT_TRUE(query.run_link(i, X_FL[i], {&cloud}, &link));
      const bool inside =
          is_inside(model->links[i].tree, X_FL[i], cloud.region, config.max_distance);
      all_inside = all_inside && inside;
      ASSERT_NO_FATAL_FAILURE(expect_bounds(link, truth, inside, config));
      clear += link.state == LinkState::kClear;
      unknown += link.state == LinkState::kUnknown;
      if (!is_measured(link)) continue;
      ++measured;
      cut += link.distance > link.lower_bound + config.tolerance + kRounding;
    }
    RobotProximity robot;
    ASSERT_TRUE(query.run_minimum(X_FL, known, {&cloud}, &robot));
    ASSERT_LE(robot.nearest.lower_bound, least);
    if (robot.nearest.state == LinkState::kClear) ASSERT_TRUE(all_inside);
  }
  EXPECT_GT(clear, 0);
  EXPECT_GT(measured, 0);
  EXPECT_GT(unknown, 0);
  EXPECT_GT(cut, 0);
}

// The same question is answered without a search: it must still be told that a link is outside.
// With another region it is another question.
TEST(RegionOfInterest, CountsInAnswersThatAreRepeated) {
  const auto model = test::make_model({test::icosphere(0.08, 2)}, 0.005);
  CloudSnapshot cloud = test::make_snapshot({{1.0, 0.0, 0.0}});
  cloud.region.radius = 1.1;
  QueryConfig config;
  config.max_distance = 0.5;
  for (const double deadline : {0.0, 10.0}) {
    config.deadline = deadline;
    ProximityQuery query(model, config);
    const std::vector<Eigen::Isometry3d> X_FL = {test::at(0.0, 0.9, 0.0)};
    std::vector<LinkProximity> first, again;
    ASSERT_TRUE(query.run(X_FL, {true}, {&cloud}, &first));
    EXPECT_EQ(query.statistics().outside_region, 1U);
    EXPECT_EQ(first[0].state, LinkState::kUnknown);
    ASSERT_TRUE(query.run(X_FL, {true}, {&cloud}, &again));
    EXPECT_EQ(query.statistics().outside_region, 1U);
    EXPECT_EQ(again[0].state, LinkState::kUnknown);
    CloudSnapshot whole = cloud;
    whole.region = RegionOfInterest();
    ASSERT_TRUE(query.run(X_FL, {true}, {&whole}, &again));
    EXPECT_EQ(query.statistics().outside_region, 0U);
    EXPECT_EQ(again[0].state, LinkState::kClear);
    ASSERT_TRUE(query.run(X_FL, {true}, {&cloud}, &again));
    EXPECT_EQ(again[0].state, LinkState::kUnknown);
  }
}

}  // namespace
}  // namespace ist
