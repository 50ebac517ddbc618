#include "ist_proximity/robot/robot_model.h"

#include <gtest/gtest.h>

#include <string>

#include "ist_proximity/geometry/error.h"
#include "support/meshes.h"

namespace ist {
namespace {

LinkDescription link(const std::string& name, const Shape& shape) {
  LinkDescription result;
  result.name = name;
  result.geometry.emplace_back();
  result.geometry.back().shape = shape;
  return result;
}

// A robot of an "arm", a link "flange" without geometry, a "finger" and a faulty link.
RobotDescription robot() {
  RobotDescription result;
  result.name = "robot";
  result.root_link = "arm";
  result.links = {link("arm", test::l_shape(0.1, 0.03)), link("finger", Box{{0.02, 0.03, 0.2}}),
                  link("faulty", Sphere{0.1})};
  result.links.back().error = "link 'faulty': no such file";
  result.links_without_geometry = {"flange"};
  result.link_order = {"arm", "flange", "finger", "faulty"};
  return result;
}

AttachedObject sphere_on(const std::string& link) {
  AttachedObject object;
  object.name = "sphere on " + link;
  object.link = link;
  object.element.shape = Sphere{0.07};
  object.element.X_LE.translation() << 0.05, -0.1, 0.2;
  return object;
}

TEST(AttachedObject, linksThatCannotCarry) {
  const auto message_of = [](const std::string& link) {
    try {
      with_objects(robot(), {sphere_on(link)});
    } catch (const ModelError& error) {
      return std::string(error.what());
    }
    return std::string("(no error)");
  };
  EXPECT_NE(message_of("hand").find("link 'hand' is not in the URDF"), std::string::npos);
  EXPECT_NE(message_of("faulty").find("no such file"), std::string::npos);
  EXPECT_EQ(message_of("flange"), "(no error)");
}

}  // namespace
}  // namespace ist
