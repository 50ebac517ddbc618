// When what has been seen of the space about the robot may not be used.

#include "ros/unknown_space/unknown_space.h"

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "support/errors.h"
#include "support/robot_of_links.h"

namespace ist {
namespace {

std::shared_ptr<const RobotModel> robot_of_a_box(double height) {
  const Box box{Eigen::Vector3d(0.2, 0.1, height)};
  return build_robot_model(test::robot_of({{{box, Eigen::Isometry3d::Identity(), "box"}}}), {});
}

TEST(UnknownSpace, CountsForTheRobotAndTheFrameThatItWasSeenFor) {
  UnknownSnapshot unknown;
  unknown.frame = "base";
  unknown.stamp = 100.0;
  unknown.robot = robot_of_a_box(0.5);
  const ros::Time later(100.5);
  EXPECT_EQ(why_unusable(unknown, *unknown.robot, "base", later), "");
  EXPECT_EQ(why_unusable(unknown, RobotModel(*unknown.robot), "base", later), "");
  test::expect_says(why_unusable(unknown, *robot_of_a_box(0.4), "base", later),
                    "the robot is another one since it was seen");
  test::expect_says(why_unusable(unknown, *unknown.robot, "map", later),
                    "the fixed frame is another one since it was seen");
  test::expect_says(why_unusable(unknown, *unknown.robot, "base", ros::Time(90.0)),
                    "what was seen last is of 10.00 s after the present");
  unknown.found = 100.0;
  unknown.lasts = 1.0;
  EXPECT_EQ(why_unusable(unknown, *unknown.robot, "base", ros::Time(101.0)), "");
  test::expect_says(why_unusable(unknown, *unknown.robot, "base", ros::Time(101.5)),
                    "was found 1.50 s ago");
}

}  // namespace
}  // namespace ist
