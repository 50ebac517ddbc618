// Where mimic joints are against where the joints that they follow put them.

#include "ros/poses/mimic_agreement.h"

#include <gtest/gtest.h>

#include <string>

#include "ist_proximity/robot/robot_description.h"
#include "support/errors.h"

namespace ist {
namespace {

// A crank that leads a wheel, or a slide.
Kinematics crank(const std::string& type, const std::string& led, double multiplier) {
  const std::string limits = R"(<limit lower="-1" upper="5" velocity="1" effort="1"/>)";
  const std::string urdf =
      R"(<robot name="r"><link name="base"/><link name="a"/><link name="b"/>
      <joint name="crank" type=")" +
      type + R"("><parent link="base"/><child link="a"/><origin rpy="0.3 0.2 0.1"/>)" + limits +
      R"(<axis xyz="1 2 3"/></joint><joint name="led" type=")" + led +
      R"("><parent link="a"/><child link="b"/><origin xyz="1 2 3" rpy="1 0 2"/>)" + limits +
      R"(<axis xyz="-2 1 1"/><mimic joint="crank" offset="0.2" multiplier=")" +
      std::to_string(multiplier) + R"("/></joint></robot>)";
  return Kinematics(
      parse_urdf(urdf, GeometrySource::kCollision, [](const std::string&) { return ""; }));
}

std::string told_by_poses(const Kinematics& kinematics, double q, double stated) {
  return why_not_led(kinematics, 1, kinematics.joint_pose(0, q), kinematics.joint_pose(1, stated),
                     0.1);
}

TEST(MimicAgreement, OneThatStraysIsNamed) {
  const Kinematics slide = crank("revolute", "prismatic", -2.0);
  EXPECT_EQ(told_by_poses(slide, 0.5, -0.75), "");
  test::expect_says(told_by_poses(slide, 0.5, -0.65),
                    "joint 'led' is stated at -0.650, but would be at -0.800 as a mimic of joint "
                    "'crank'");
}

TEST(MimicAgreement, WholeTurnsAreNotTold) {
  for (const char* led : {"prismatic", "revolute", "continuous"}) {
    for (const double multiplier : {-2.0, 0.5, 1.0}) {
      SCOPED_TRACE(led + std::to_string(multiplier));
      const Kinematics limited = crank("revolute", led, multiplier);
      const Kinematics endless = crank("continuous", led, multiplier);
      for (const double q : {-0.9, 0.0, 1.0, 3.0, 4.9}) {
        const double there = multiplier * q + 0.2;
        for (const Kinematics* one : {&limited, &endless}) {
          EXPECT_EQ(told_by_poses(*one, q, there), "");
          EXPECT_EQ(told_by_poses(*one, q, there + 0.09), "");
          EXPECT_NE(told_by_poses(*one, q, there + 0.2), "");
        }
        const double turn = 2.0 * M_PI * multiplier;
        EXPECT_EQ(told_by_poses(endless, q + 8.0 * M_PI, there + 4.0 * turn), "");
      }
    }
  }
}

}  // namespace
}  // namespace ist
