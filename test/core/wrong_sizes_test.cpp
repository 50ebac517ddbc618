// Poses and positions of another robot than the query's: nothing is read past the end of them, and
// what they do not say is not known.

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/kinematics.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr std::size_t kLinks = 3;

std::shared_ptr<RobotModel> model() {
  return test::make_model({Box{{0.1, 0.1, 0.1}}, Sphere{0.1}, Cylinder{0.1, 0.2}}, 0.01);
}

std::vector<Eigen::Isometry3d> poses(std::size_t count) {
  return std::vector<Eigen::Isometry3d>(count, Eigen::Isometry3d::Identity());
}

bool is_unknown(const LinkProximity& answer) {
  return answer.state == LinkState::kUnknown && std::isnan(answer.distance) &&
         answer.lower_bound == -std::numeric_limits<double>::infinity();
}

// By vectors of exactly the size, so that the address sanitizer sees a read past their end.
TEST(WrongSizes, LinksAreUnknown) {
  const auto robot = model();
  const CloudSnapshot cloud = test::make_snapshot({{0.5, 0.0, 0.0}});
  ProximityQuery query(robot, {});
  std::vector<LinkProximity> answers;
  const auto all_unknown = [&](std::size_t X_count, std::size_t known_count) {
    query.run(poses(kLinks), std::vector<bool>(kLinks, true), {&cloud}, &answers);
    EXPECT_EQ(answers[0].state, LinkState::kNear);
    query.run(poses(X_count), std::vector<bool>(known_count, true), {&cloud}, &answers);
    ASSERT_EQ(answers.size(), kLinks);
    for (const LinkProximity& answer : answers) EXPECT_TRUE(is_unknown(answer));
    RobotProximity minimum;
    query.run_minimum(poses(X_count), std::vector<bool>(known_count, true), {&cloud}, &minimum);
    EXPECT_TRUE(is_unknown(minimum.nearest));
    EXPECT_FALSE(minimum.all_known);
  };
  all_unknown(0, kLinks);
  all_unknown(kLinks - 1, kLinks);
  all_unknown(kLinks, 0);
  all_unknown(kLinks, kLinks - 1);
  all_unknown(kLinks + 1, kLinks + 1);
  LinkProximity answer;
  query.run_link(kLinks, Eigen::Isometry3d::Identity(), {&cloud}, &answer);
  EXPECT_TRUE(is_unknown(answer));
  query.run(poses(kLinks), std::vector<bool>(kLinks, true), {&cloud}, &answers);
  EXPECT_EQ(answers[0].state, LinkState::kNear);
}

TEST(WrongSizes, PairsAreUnknown) {
  const auto robot = model();
  SelfQuery query(robot, {{0, 1}, {1, kLinks}}, {});
  std::vector<PairProximity> answers;
  query.run(poses(kLinks), std::vector<bool>(kLinks, true), &answers);
  ASSERT_EQ(answers.size(), 2U);
  EXPECT_EQ(answers[0].state, LinkState::kContact);
  EXPECT_EQ(answers[1].state, LinkState::kUnknown);
  query.run(poses(kLinks - 1), std::vector<bool>(kLinks, true), &answers);
  EXPECT_EQ(answers[0].state, LinkState::kUnknown);
  query.run(poses(kLinks), std::vector<bool>(kLinks - 1, true), &answers);
  EXPECT_EQ(answers[0].state, LinkState::kUnknown);
}

TEST(WrongSizes, RepulsionIsUnknown) {
  const auto robot = model();
  const CloudSnapshot cloud = test::make_snapshot({{0.2, 0.0, 0.0}});
  ProximityQuery query(robot, {});
  std::vector<LinkProximity> answers;
  query.run(poses(kLinks), std::vector<bool>(kLinks, true), {&cloud}, &answers);
  const RepulsiveWrench wrench = Repulsion(robot).wrench(kLinks, Eigen::Isometry3d::Identity(),
                                                         {&cloud}, answers[0], RepulsionConfig());
  EXPECT_TRUE(wrench.force.array().isNaN().all());
}

TEST(WrongSizes, BodiesAreUnknown) {
  const RobotDescription robot = parse_urdf(
      "<robot name='r'><link name='a'/><link name='b'/><link name='c'/>"
      "<joint name='ab' type='revolute'><parent link='a'/><child link='b'/><axis xyz='0 0 1'/>"
      "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint>"
      "<joint name='bc' type='revolute'><parent link='b'/><child link='c'/><axis xyz='0 0 1'/>"
      "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint></robot>",
      GeometrySource::kCollision, environment_package_finder());
  const Kinematics kinematics(robot);
  JointPoses joints;
  BodyPoses bodies;
  for (const std::size_t size : {0U, 1U, 3U}) {
    kinematics.place_joints(std::vector<double>(size, 0.0), &joints);
    EXPECT_EQ(joints.known, std::vector<bool>(2, false));
    JointPoses others;
    others.X_PC = poses(size);
    others.known.assign(size, true);
    kinematics.place_bodies(others, Eigen::Isometry3d::Identity(), &bodies);
    EXPECT_EQ(bodies.known, std::vector<bool>(3, false));
    EXPECT_EQ(kinematics.first_unknown(others, 2).has_value(), size < 2);
  }
  Jacobian J;
  point_jacobian(kinematics, poses(2), 1, Eigen::Vector3d::Zero(), &J);
  EXPECT_TRUE(J.array().isNaN().all());
  point_jacobian(kinematics, poses(3), 3, Eigen::Vector3d::Zero(), &J);
  EXPECT_TRUE(J.array().isNaN().all());
  point_jacobian(kinematics, poses(3), 2, Eigen::Vector3d::Zero(), &J);
  EXPECT_TRUE(J.allFinite());
  EXPECT_EQ(first_body_needed(kinematics, std::vector<bool>(2, true), 1), 1U);
  EXPECT_EQ(first_body_needed(kinematics, std::vector<bool>(3, true), 3), 3U);
}

}  // namespace
}  // namespace ist
