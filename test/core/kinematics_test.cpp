#include "ist_proximity/robot/kinematics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/link_poses.h"
#include "support/allocations.h"
#include "support/errors.h"
#include "support/random_robots.h"

namespace ist {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kPi = 3.14159265358979323846;

Kinematics kinematics(const std::string& content) {
  return Kinematics(
      parse_urdf("<robot name=\"test\">" + content + "</robot>", GeometrySource::kCollision, {}));
}

std::string links(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += "<link name=\"l" + std::to_string(i) + "\"/>";
  return text;
}

// Joint `name` from link l<parent> to l<child>.
std::string joint(const std::string& name, const std::string& type, int parent, int child,
                  const std::string& inside) {
  return "<joint name=\"" + name + "\" type=\"" + type + "\"><parent link=\"l" +
         std::to_string(parent) + "\"/><child link=\"l" + std::to_string(child) + "\"/>" + inside +
         "<limit lower=\"-1\" upper=\"2\" effort=\"1\" velocity=\"1\"/></joint>";
}

std::string error_of(const std::string& content) {
  return test::error_of([&] { kinematics(content); });
}

using test::expect_says;

// Positions by name of the joint; the other ones are NaN.
std::vector<double> positions(const Kinematics& k, const std::map<std::string, double>& q) {
  std::vector<double> result(k.joints().size(), kNaN);
  for (const auto& [name, value] : q) result[k.find_joint(name).value()] = value;
  return result;
}

struct Placed {
  JointPoses joints;
  BodyPoses bodies;
};

Placed place(const Kinematics& k, const std::map<std::string, double>& q,
             const Eigen::Isometry3d& X_FR = Eigen::Isometry3d::Identity()) {
  Placed placed;
  k.place_joints(positions(k, q), &placed.joints);
  k.place_bodies(placed.joints, X_FR, &placed.bodies);
  return placed;
}

TEST(Kinematics, chainsOfMimics) {
  const std::string axis = "<axis xyz=\"0 0 1\"/>";
  const Kinematics k = kinematics(
      links(5) +
      // The mimic joints precede the joint that they follow, by name and by place.
      joint("a", "continuous", 0, 1,
            axis + "<mimic joint=\"b\" multiplier=\"-2\" offset=\"0.1\"/>") +
      joint("b", "prismatic", 0, 2, axis + "<mimic joint=\"c\" multiplier=\"3\" offset=\"0.5\"/>") +
      joint("c", "revolute", 2, 3, axis) +
      joint("d", "revolute", 3, 4, axis + "<mimic joint=\"c\"/>"));
  const double c = 0.7, b = 3 * c + 0.5, a = -2 * b + 0.1;
  Placed placed = place(k, {{"c", c}});
  const auto X = [&](const std::string& link) { return placed.bodies.X_FB[*k.find_body(link)]; };
  EXPECT_NEAR(X("l2").translation().z(), b, 1e-15);
  const Eigen::Matrix3d turned_a =
      Eigen::AngleAxisd(a, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_TRUE(X("l1").linear().isApprox(turned_a, 1e-14));
  const Eigen::Matrix3d turned_c_d =
      Eigen::AngleAxisd(2 * c, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_TRUE(X("l4").linear().isApprox(turned_c_d, 1e-14));
  for (const char* name : {"a", "b", "d"}) EXPECT_FALSE(k.joints()[*k.find_joint(name)].is_free());
  EXPECT_TRUE(k.joints()[*k.find_joint("c")].is_free());
  // A stated position counts: for the joint, which needs none to follow, and for those that mimic
  // it.
  placed = place(k, {{"c", c}, {"b", 0.2}});
  const Eigen::Matrix3d turned_by_b =
      Eigen::AngleAxisd(-2 * 0.2 + 0.1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_EQ(X("l2").translation().z(), 0.2);
  EXPECT_TRUE(X("l1").linear().isApprox(turned_by_b, 1e-14));
  EXPECT_TRUE(X("l4").linear().isApprox(turned_c_d, 1e-14));
  placed = place(k, {{"b", 0.2}});
  EXPECT_TRUE(placed.bodies.known[*k.find_body("l2")]);
  EXPECT_TRUE(X("l1").linear().isApprox(turned_by_b, 1e-14));
  EXPECT_FALSE(placed.bodies.known[*k.find_body("l3")]);
  std::vector<double> q = positions(k, {{"b", 0.2}});
  k.place_mimics(&q);
  EXPECT_NEAR(q[*k.find_joint("a")], -2 * 0.2 + 0.1, 1e-15);
  EXPECT_TRUE(std::isnan(q[*k.find_joint("d")]));
  ASSERT_EQ(k.mimics().size(), 3u);
}

TEST(Kinematics, bodiesBelowUnknownJointsAreUnknown) {
  const Kinematics k =
      kinematics(links(6) + joint("a", "revolute", 0, 1, "") + joint("b", "floating", 1, 2, "") +
                 joint("c", "revolute", 2, 3, "") + joint("d", "planar", 0, 4, "") +
                 joint("e", "fixed", 4, 5, ""));
  const auto body = [&](const char* name) { return *k.find_body(name); };
  Placed placed = place(k, {{"a", 0.1}});
  for (const char* name : {"l0", "l1"}) EXPECT_TRUE(placed.bodies.known[body(name)]) << name;
  for (const char* name : {"l2", "l3", "l4", "l5"})
    EXPECT_FALSE(placed.bodies.known[body(name)]) << name;
  const auto blamed = [&](const char* name) {
    const auto joint = k.first_unknown(placed.joints, body(name));
    return joint ? k.joints()[*joint].name : "";
  };
  EXPECT_EQ(blamed("l1"), "");
  EXPECT_EQ(blamed("l3"), "b");  // before c, which is not known either
  EXPECT_EQ(blamed("l5"), "d");

  // The caller's pose for the floating joint, and nothing but c missing below it.
  const std::size_t b = *k.find_joint("b");
  EXPECT_TRUE(k.joints()[b].has_unstated_pose());
  placed.joints.X_PC[b] = Eigen::Isometry3d(Eigen::Translation3d(1, 2, 3));
  placed.joints.known[b] = true;
  k.place_bodies(placed.joints, Eigen::Isometry3d::Identity(), &placed.bodies);
  EXPECT_TRUE(placed.bodies.known[body("l2")]);
  EXPECT_EQ(blamed("l3"), "c");
  const Eigen::Vector3d expected =
      Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()) * Eigen::Vector3d(1, 2, 3);
  EXPECT_TRUE(placed.bodies.X_FB[body("l2")].translation().isApprox(expected, 1e-15));
}

TEST(Kinematics, faults) {
  expect_says(error_of(links(2) + joint("a", "revolute", 0, 1, "<axis xyz=\"0 0 0\"/>")),
              "joint 'a': its <axis> has length 0");
  expect_says(error_of(links(2) + joint("a", "revolute", 0, 1, "<mimic joint=\"z\"/>")),
              "joint 'a' mimics joint 'z', which is not in the URDF");
  expect_says(error_of(links(2) + joint("a", "revolute", 0, 1, "<mimic joint=\"a\"/>")), "ring");
  expect_says(error_of(links(3) + joint("a", "revolute", 0, 1, "<mimic joint=\"b\"/>") +
                       joint("b", "prismatic", 1, 2, "<mimic joint=\"a\"/>")),
              "ring");
  expect_says(error_of(links(3) + joint("a", "revolute", 0, 1, "<mimic joint=\"b\"/>") +
                       joint("b", "floating", 1, 2, "")),
              "joint 'a' mimics joint 'b', which has no position");
  // A joint without a position needs no axis.
  EXPECT_EQ(error_of(links(2) + joint("a", "fixed", 0, 1, "<axis xyz=\"0 0 0\"/>")), "(no error)");
}

// A joint's motion by Rodrigues' formula, and its chain by plain products of 4x4 matrices.
Eigen::Matrix4d naive_motion(JointType type, const Eigen::Vector3d& axis, double q) {
  Eigen::Matrix4d X = Eigen::Matrix4d::Identity();
  const Eigen::Vector3d n = axis.normalized();
  if (type == JointType::kPrismatic) {
    X.topRightCorner<3, 1>() = q * n;
  } else if (type != JointType::kFixed) {
    Eigen::Matrix3d cross;
    cross << 0, -n.z(), n.y(), n.z(), 0, -n.x(), -n.y(), n.x(), 0;
    X.topLeftCorner<3, 3>() += std::sin(q) * cross + (1 - std::cos(q)) * cross * cross;
  }
  return X;
}

TEST(Kinematics, randomTreesAgainstNaiveProducts) {
  test::Rng random(7);
  for (int trial = 0; trial < 200; ++trial) {
    RobotDescription robot = test::random_robot(&random, 20);
    std::map<std::string, double> stated;
    std::map<std::string, Eigen::Matrix4d> X_RL{{"l0", Eigen::Matrix4d::Identity()}};
    std::map<std::string, double> q;
    for (const JointDescription& joint : robot.joints) {
      q[joint.name] = joint.mimic
                          ? joint.mimic->multiplier * q[joint.mimic->joint] + joint.mimic->offset
                          : test::uniform(&random, -4, 4);
      if (!joint.mimic) stated[joint.name] = q[joint.name];
      X_RL[joint.child_link] = X_RL[joint.parent_link] * joint.X_PJ.matrix() *
                               naive_motion(joint.type, joint.axis, q[joint.name]);
    }
    std::shuffle(robot.joints.begin(), robot.joints.end(), random);

    const Kinematics k(robot);
    const Eigen::Isometry3d X_FR = test::random_pose(&random, 1.0);
    const Placed placed = place(k, stated, X_FR);
    ASSERT_EQ(k.bodies().size(), X_RL.size());
    for (std::size_t i = 0; i < k.bodies().size(); ++i) {
      ASSERT_TRUE(placed.bodies.known[i]);
      const Eigen::Matrix4d expected = X_FR.matrix() * X_RL.at(k.bodies()[i]);
      EXPECT_LT((placed.bodies.X_FB[i].matrix() - expected).cwiseAbs().maxCoeff(), 1e-13);
    }
  }
}

// Links of a model, in an order of their own, one of which the URDF lacks.
RobotModel model_with_links(const std::vector<std::string>& names) {
  RobotModel model;
  for (const std::string& name : names) {
    model.links.emplace_back();
    model.links.back().name = name;
  }
  return model;
}

TEST(LinkPoses, areByLinkOfTheModel) {
  const auto k = std::make_shared<const Kinematics>(
      kinematics(links(4) + joint("a", "revolute", 0, 1, "<origin xyz=\"1 0 0\"/>") +
                 joint("b", "floating", 1, 2, "<origin xyz=\"0 2 0\"/>") +
                 joint("c", "fixed", 0, 3, "<origin xyz=\"0 0 3\"/>")));
  const RobotModel model = model_with_links({"l3", "nowhere", "l2", "l1"});
  const Eigen::Isometry3d X_FR(Eigen::Translation3d(5, 5, 5));
  const std::vector<double> q = positions(*k, {{"a", 0.1}});
  const LinkPoses poses = link_poses(model, *k, q, X_FR);
  EXPECT_EQ(poses.known, (std::vector<bool>{true, false, false, true}));
  BodyPoses bodies;
  JointPoses joints;
  k->place_joints(q, &joints);
  k->place_bodies(joints, X_FR, &bodies);
  EXPECT_EQ(poses.X_FL[0].matrix(), bodies.X_FB[*k->find_body("l3")].matrix());
  EXPECT_EQ(poses.X_FL[3].matrix(), bodies.X_FB[*k->find_body("l1")].matrix());

  // The caller's pose for the floating joint.
  joints.X_PC[*k->find_joint("b")] = k->joints()[*k->find_joint("b")].X_PJ;
  joints.known[*k->find_joint("b")] = true;
  ForwardKinematics forward(model, k);
  EXPECT_EQ(forward.run(q, X_FR).known, poses.known);
  EXPECT_EQ(forward.run(joints, X_FR).known, (std::vector<bool>{true, false, true, true}));
  EXPECT_EQ(forward.links().X_FL[2].matrix(), forward.bodies().X_FB[*forward.body(2)].matrix());
  EXPECT_FALSE(forward.body(1).has_value());
}

TEST(LinkPoses, inALoopAllocateNothing) {
  const auto k = std::make_shared<const Kinematics>(
      kinematics(links(3) + joint("a", "revolute", 0, 1, "") + joint("b", "prismatic", 1, 2, "")));
  const RobotModel model = model_with_links({"l0", "l2"});
  ForwardKinematics forward(model, k);
  std::vector<double> q = {0.1, 0.2};
  forward.run(q);
  const long before = test::allocations;
  for (int i = 0; i < 10; ++i) {
    q[0] += 0.1;
    forward.run(q);
  }
  EXPECT_EQ(test::allocations, before);
}

}  // namespace
}  // namespace ist
