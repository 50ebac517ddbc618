#include "ist_proximity/robot/robot_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

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

RobotModelConfig config() {
  RobotModelConfig result;
  result.packing.max_error = 0.01;
  result.packing.max_spheres = 300;
  return result;
}

void expect_equal(const RobotModel& a, const RobotModel& b) {
  ASSERT_EQ(a.links.size(), b.links.size());
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(-0.4, 0.4);
  for (std::size_t i = 0; i < a.links.size(); ++i) {
    EXPECT_EQ(a.links[i].name, b.links[i].name);
    EXPECT_EQ(a.links[i].error, b.links[i].error);
    ASSERT_EQ(a.links[i].packing.spheres.size(), b.links[i].packing.spheres.size());
    for (std::size_t k = 0; k < a.links[i].packing.spheres.size(); ++k) {
      EXPECT_EQ(a.links[i].packing.spheres[k].center, b.links[i].packing.spheres[k].center);
    }
    for (int k = 0; k < 100 && a.links[i].usable(); ++k) {
      const Eigen::Vector3d p(number(random), number(random), number(random));
      EXPECT_EQ(a.links[i].solid.signed_distance(p).distance,
                b.links[i].solid.signed_distance(p).distance);
    }
  }
}

TEST(AttachedObject, rebuildingOneLinkEqualsBuildingAll) {
  const auto bare = build_robot_model(robot(), config());
  for (const char* name : {"arm", "flange", "finger"}) {
    const RobotDescription carrying = with_objects(robot(), {sphere_on(name)});
    const auto whole = build_robot_model(carrying, config());
    const auto rebuilt = rebuild_link(*bare, carrying, name, config());
    expect_equal(*rebuilt, *whole);
    // Detaching restores the model.
    expect_equal(*rebuild_link(*rebuilt, robot(), name, config()), *bare);
  }
}

TEST(AttachedObject, onlyLinksThatAreAskedFor) {
  RobotModelConfig some = config();
  some.links = {"finger"};
  const auto bare = build_robot_model(robot(), some);
  const RobotDescription carrying = with_objects(robot(), {sphere_on("flange")});
  EXPECT_EQ(rebuild_link(*bare, carrying, "flange", some)->links.size(), 1U);
  some.links = {"finger", "flange"};
  const auto rebuilt = rebuild_link(*bare, carrying, "flange", some);
  ASSERT_EQ(rebuilt->links.size(), 2U);
  EXPECT_EQ(rebuilt->links[0].name, "flange");
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [] { return true; };
  EXPECT_EQ(rebuild_link(*bare, carrying, "flange", some, callbacks), nullptr);
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
