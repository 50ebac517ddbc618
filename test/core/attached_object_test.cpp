#include <gtest/gtest.h>

#include <string>

#include "ist_proximity/robot/robot_model.h"
#include "support/errors.h"

namespace ist {
namespace {

TEST(AttachedObject, linksThatCannotCarry) {
  RobotDescription robot;
  robot.name = "robot";
  robot.root_link = "flange";
  robot.links.resize(1);
  robot.links[0].name = "faulty";
  robot.links[0].error = "link 'faulty': no such file";
  robot.links_without_geometry = {"flange"};
  robot.link_order = {"flange", "faulty"};
  const auto message_of = [&](const std::string& link) {
    AttachedObject object;
    object.name = "sphere on " + link;
    object.link = link;
    object.element.shape = Sphere{0.07};
    return test::error_of([&] { with_objects(robot, {object}); });
  };
  test::expect_says(message_of("hand"), "link 'hand' is not in the URDF");
  test::expect_says(message_of("faulty"), "no such file");
  EXPECT_EQ(message_of("flange"), "(no error)");
}

}  // namespace
}  // namespace ist
