#include "ist_proximity/robot/robot_model.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "internal/robot/link_packing.h"
#include "ist_proximity/geometry/error.h"
#include "support/errors.h"
#include "support/meshes.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

GeometryElement element(const Shape& shape, double z = 0.0) {
  return {shape, test::at(0.0, 0.0, z), "test"};
}

LinkDescription link(const std::string& name, LinkGeometry geometry) {
  LinkDescription result;
  result.name = name;
  result.geometry = std::move(geometry);
  return result;
}

// A robot of two equal fingers (one of them turned), a hand of two elements, and a faulty link.
RobotDescription gripper() {
  RobotDescription robot;
  robot.name = "gripper";
  robot.root_link = "hand";
  robot.links.push_back(link(
      "hand", {element(test::torus(0.05, 0.02, 24, 12)), element(Box{{0.02, 0.2, 0.02}}, 0.05)}));
  robot.links.push_back(link("left", {element(test::l_shape(0.05, 0.01))}));
  robot.links.push_back(link("faulty", {}));
  robot.links.back().error = "link 'faulty', collision element 1 (a.stl): does not exist";
  robot.links.push_back(link("right", {element(test::l_shape(0.05, 0.01))}));
  robot.links.back().geometry[0].X_LE.rotate(
      Eigen::AngleAxisd(static_cast<double>(EIGEN_PI), Eigen::Vector3d::UnitZ()));
  robot.links_without_geometry = {"tip"};
  robot.link_order = {"hand", "left", "tip", "faulty", "right"};
  return robot;
}

std::vector<std::string> names(const RobotModel& model) {
  std::vector<std::string> result;
  for (const LinkModel& l : model.links) result.push_back(l.name);
  return result;
}

TEST(RobotModel, buildsEveryLinkThatHasGeometry) {
  const auto model = build_robot_model(gripper(), {});
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->name, "gripper");
  EXPECT_EQ(model->root_link, "hand");
  EXPECT_EQ(names(*model), (std::vector<std::string>{"hand", "left", "faulty", "right"}));
  for (const LinkModel& l : model->links) {
    EXPECT_EQ(l.usable(), l.name != "faulty");
    EXPECT_EQ(l.packing.spheres.empty(), !l.usable());
    EXPECT_EQ(l.tree.sphere_count(), l.packing.spheres.size());
    EXPECT_EQ(l.solid.empty(), !l.usable());
    EXPECT_FALSE(l.from_cache);
    if (!l.usable()) continue;
    EXPECT_LE(l.packing.certificate.max_gap, 0.005) << l.name;
    EXPECT_TRUE(l.packing.certificate.reached) << l.name;
  }
  test::expect_says(model->links[2].error, "a.stl");
}

TEST(RobotModel, monitorsTheLinksThatAreNamedInUrdfOrder) {
  RobotModelConfig config;
  config.links = {"right", "nobody", "tip", "left", "right"};
  const auto model = build_robot_model(gripper(), config);
  ASSERT_EQ(names(*model), (std::vector<std::string>{"left", "tip", "right", "nobody"}));
  EXPECT_TRUE(model->links[0].usable());
  test::expect_says(model->links[1].error, "'tip'");
  test::expect_says(model->links[1].error, "no geometry");
  test::expect_says(model->links[3].error, "'nobody'");
  test::expect_says(model->links[3].error, "not in the URDF");
}

TEST(RobotModel, worksWithoutACacheThatCannotBeWritten) {
  const test::TempDir dir;
  RobotModelConfig config;
  config.cache_directory = dir.write("file", "in the way") + "/cache";
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& text) { warnings.push_back(text); };
  EXPECT_TRUE(build_robot_model(gripper(), config, callbacks)->links[0].usable());
  ASSERT_EQ(warnings.size(), 1U) << "once is enough";
  test::expect_says(warnings[0], config.cache_directory);
}

TEST(RobotModel, warnsAboutVisualFallbackAndTooFewSpheres) {
  RobotDescription robot = gripper();
  robot.links[1].used_visual_fallback = true;
  RobotModelConfig config;
  config.packing.max_spheres = 10;
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& text) { warnings.push_back(text); };
  config.links = {"left"};
  const auto model = build_robot_model(robot, config, callbacks);
  EXPECT_FALSE(model->links[0].packing.certificate.reached);
  ASSERT_EQ(warnings.size(), 2U);
  test::expect_says(warnings[0], "'left' has no collision geometry");
  test::expect_says(warnings[1], "max_spheres (10)");
  test::expect_says(warnings[1], " mm");
  warnings.clear();
  robot.links[0].used_visual_fallback = true;
  config.links = {robot.links[0].name, "left"};
  config.packing.max_spheres = 20000;
  build_robot_model(robot, config, callbacks);
  ASSERT_EQ(warnings.size(), 1U) << "one for all links";
  test::expect_says(warnings[0],
                    "'" + robot.links[0].name + "', 'left' have no collision geometry");
  warnings.clear();
  robot.links[0].used_visual_fallback = false;
  config.links = {"hand"};  // no warning for links that are not monitored
  build_robot_model(robot, config, callbacks);
  EXPECT_TRUE(warnings.empty());
}

TEST(RobotModel, reportsProgressOneCallAtATimeUpToTheEnd) {
  std::atomic<int> inside{0};
  std::vector<ModelProgress> reports;
  bool overlapped = false;
  RobotModelCallbacks callbacks;
  callbacks.progress = [&](const ModelProgress& progress) {
    overlapped = overlapped || ++inside > 1;
    reports.push_back(progress);
    std::this_thread::yield();
    --inside;
  };
  RobotModelConfig config;
  config.threads = 4;
  build_robot_model(gripper(), config, callbacks);
  EXPECT_FALSE(overlapped);
  ASSERT_FALSE(reports.empty());
  double last = 0.0;
  for (const ModelProgress& report : reports) {
    EXPECT_GE(report.fraction, last);
    last = report.fraction;
    EXPECT_EQ(report.count, 4U);
    EXPECT_EQ(report.link, gripper().links.at(report.index).name);
  }
  EXPECT_EQ(last, 1.0);
}

TEST(RobotModel, canBeCancelled) {
  RobotModelCallbacks callbacks;
  callbacks.cancelled = [] { return true; };
  EXPECT_EQ(build_robot_model(gripper(), {}, callbacks), nullptr);

  // Cancelled while it packs: the next start must not find a partial packing.
  const test::TempDir dir;
  RobotModelConfig config;
  config.cache_directory = dir.file("cache");
  config.packing.max_error = 0.002;
  config.threads = 1;
  int calls = 0;
  callbacks.cancelled = [&] { return ++calls > 4; };
  EXPECT_EQ(build_robot_model(gripper(), config, callbacks), nullptr);
  callbacks.cancelled = {};
  const auto model = build_robot_model(gripper(), config, callbacks);
  for (const LinkModel& l : model->links) {
    if (l.usable()) {
      EXPECT_TRUE(l.packing.certificate.reached) << l.name;
    }
  }
}

TEST(RobotModel, passesOnExceptionsOfCallbacks) {
  RobotModelCallbacks callbacks;
  callbacks.progress = [](const ModelProgress&) { throw std::runtime_error("stop it"); };
  EXPECT_THROW(build_robot_model(gripper(), {}, callbacks), std::runtime_error);
}

TEST(RobotModel, refusesAnInvalidPackingConfiguration) {
  RobotModelConfig config;
  for (const double bad : {0.0, std::nan("")}) {
    config.packing.max_error = bad;
    EXPECT_THROW(build_robot_model(gripper(), config), ModelError);
  }
  config.packing = {};
  config.packing.max_spheres = 0;
  EXPECT_THROW(build_robot_model(gripper(), config), ModelError);
}

TEST(LinkPacking, combinesCertificates) {
  const LinkGeometry geometry = {element(Sphere{1}), element(Sphere{1})};
  Packing a, b;
  a.spheres.push_back({Eigen::Vector3d::Zero(), 1, 1});
  b.spheres = a.spheres;
  a.certificate = {0.003, 0.001, 0.004, 0.1, 1.0, true};
  b.certificate = {0.002, 0.002, 0.005, 0.2, 3.0, false};
  const PackingCertificate all = combine(geometry, {&a, &b}).certificate;
  EXPECT_EQ(all.max_gap, 0.003);
  EXPECT_EQ(all.interior_gap, 0.005);
  EXPECT_NEAR(all.mean_gap, 0.00175, 1e-15);
  EXPECT_NEAR(all.unreachable_area, 0.3, 1e-15);
  EXPECT_EQ(all.surface_area, 4.0);
  EXPECT_FALSE(all.reached);
}

}  // namespace
}  // namespace ist
