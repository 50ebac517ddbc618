#include "ist_proximity/robot/robot_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "internal/packing/packer.h"
#include "internal/robot/link_packing.h"
#include "ist_proximity/geometry/error.h"
#include "support/data_dir.h"
#include "support/errors.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

GeometryElement element(Shape shape, const Eigen::Vector3d& p_LE = Eigen::Vector3d::Zero()) {
  GeometryElement result;
  result.shape = std::move(shape);
  result.X_LE.translation() = p_LE;
  result.source = "test";
  return result;
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
  robot.links.push_back(link("hand", {element(test::torus(0.05, 0.02, 24, 12)),
                                      element(Box{{0.02, 0.2, 0.02}}, {0, 0, 0.05})}));
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

void expect_same(const Packing& a, const Packing& b) {
  ASSERT_EQ(a.spheres.size(), b.spheres.size());
  for (std::size_t i = 0; i < a.spheres.size(); ++i) {
    EXPECT_EQ(a.spheres[i].center, b.spheres[i].center);
    EXPECT_EQ(a.spheres[i].radius, b.spheres[i].radius);
    EXPECT_EQ(a.spheres[i].cover_radius, b.spheres[i].cover_radius);
  }
}

double cover_distance(const Packing& packing, const Eigen::Vector3d& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const InnerSphere& sphere : packing.spheres) {
    nearest = std::min(nearest, (p - sphere.center).norm() - sphere.cover_radius);
  }
  return nearest;
}

double inner_distance(const Packing& packing, std::size_t first_spheres, const Eigen::Vector3d& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(first_spheres, packing.spheres.size()); ++i) {
    nearest = std::min(nearest, (p - packing.spheres[i].center).norm() - packing.spheres[i].radius);
  }
  return nearest;
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
  EXPECT_NE(model->links[2].error.find("a.stl"), std::string::npos);
}

TEST(RobotModel, monitorsTheLinksThatAreNamedInUrdfOrder) {
  RobotModelConfig config;
  config.links = {"right", "nobody", "tip", "left", "right"};
  const auto model = build_robot_model(gripper(), config);
  ASSERT_EQ(names(*model), (std::vector<std::string>{"left", "tip", "right", "nobody"}));
  EXPECT_TRUE(model->links[0].usable());
  EXPECT_NE(model->links[1].error.find("'tip'"), std::string::npos) << model->links[1].error;
  EXPECT_NE(model->links[1].error.find("no geometry"), std::string::npos);
  EXPECT_NE(model->links[3].error.find("'nobody'"), std::string::npos) << model->links[3].error;
  EXPECT_NE(model->links[3].error.find("not in the URDF"), std::string::npos);
}

// Bounds must hold in the link's frame, for elements that are moved, turned and overlap.
TEST(RobotModel, packingsBoundTheExactGeometry) {
  const auto model = build_robot_model(gripper(), {});
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(-0.2, 0.2);
  for (const LinkModel& l : model->links) {
    if (!l.usable()) continue;
    for (int i = 0; i < 2000; ++i) {
      const Eigen::Vector3d p(uniform(random), uniform(random), uniform(random));
      const double exact = l.solid.signed_distance(p).distance;
      if (exact <= 0.0) continue;
      EXPECT_LE(cover_distance(l.packing, p), exact + 1e-9) << l.name << " " << p.transpose();
      EXPECT_LE(inner_distance(l.packing, l.packing.spheres.size(), p),
                exact + l.packing.certificate.max_gap + 1e-9);
      EXPECT_GE(inner_distance(l.packing, l.packing.spheres.size(), p), exact - 1e-9);
    }
  }
}

TEST(RobotModel, equalShapesArePackedOnce) {
  std::set<std::string> at_work;
  RobotModelCallbacks callbacks;
  callbacks.progress = [&](const ModelProgress& progress) { at_work.insert(progress.link); };
  RobotModelConfig config;
  config.threads = 1;  // of several links at work, the progress names the one that is longest
  const auto model = build_robot_model(gripper(), config, callbacks);
  EXPECT_EQ(at_work, (std::set<std::string>{"hand", "left"}));
  const Packing &left = model->links[1].packing, &right = model->links[3].packing;
  ASSERT_EQ(left.spheres.size(), right.spheres.size());
  for (std::size_t i = 0; i < left.spheres.size(); ++i) {
    const Eigen::Vector3d turned(-left.spheres[i].center.x(), -left.spheres[i].center.y(),
                                 left.spheres[i].center.z());
    EXPECT_TRUE(right.spheres[i].center.isApprox(turned, 1e-12));
  }
}

TEST(RobotModel, readsTheCache) {
  const test::TempDir dir;
  RobotModelConfig config;
  config.cache_directory = dir.file("cache");
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& text) { warnings.push_back(text); };
  const auto packed = build_robot_model(gripper(), config, callbacks);
  const auto cached = build_robot_model(gripper(), config, callbacks);
  EXPECT_TRUE(warnings.empty()) << warnings.front();
  for (std::size_t i = 0; i < packed->links.size(); ++i) {
    EXPECT_FALSE(packed->links[i].from_cache);
    EXPECT_EQ(cached->links[i].from_cache, cached->links[i].usable());
    expect_same(packed->links[i].packing, cached->links[i].packing);
    EXPECT_EQ(packed->links[i].packing.certificate.mean_gap,
              cached->links[i].packing.certificate.mean_gap);
  }
  config.packing.max_error = 0.004;  // another key
  EXPECT_FALSE(build_robot_model(gripper(), config, callbacks)->links[0].from_cache);
}

TEST(RobotModel, repairsADamagedCacheAndSaysSo) {
  const test::TempDir dir;
  RobotModelConfig config;
  config.cache_directory = dir.file("cache");
  build_robot_model(gripper(), config);
  for (const auto& entry : fs::directory_iterator(config.cache_directory)) {
    fs::resize_file(entry.path(), fs::file_size(entry.path()) - 1);
  }
  std::vector<std::string> warnings;
  RobotModelCallbacks callbacks;
  callbacks.warning = [&](const std::string& text) { warnings.push_back(text); };
  EXPECT_FALSE(build_robot_model(gripper(), config, callbacks)->links[0].from_cache);
  EXPECT_EQ(warnings.size(), 3U);
  warnings.clear();
  EXPECT_TRUE(build_robot_model(gripper(), config, callbacks)->links[0].from_cache);
  EXPECT_TRUE(warnings.empty());
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
  EXPECT_NE(warnings[0].find(config.cache_directory), std::string::npos) << warnings[0];
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
  EXPECT_NE(warnings[0].find("'left' has no collision geometry"), std::string::npos) << warnings[0];
  EXPECT_NE(warnings[1].find("max_spheres (10)"), std::string::npos) << warnings[1];
  EXPECT_NE(warnings[1].find(" mm"), std::string::npos) << warnings[1];
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
  config.packing.max_spheres = 20000;
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
  config.packing.max_error = 0.0;
  EXPECT_THROW(build_robot_model(gripper(), config), ModelError);
  config.packing.max_error = std::nan("");
  EXPECT_THROW(build_robot_model(gripper(), config), ModelError);
  config.packing = {};
  config.packing.max_spheres = 0;
  EXPECT_THROW(build_robot_model(gripper(), config), ModelError);
}

TEST(LinkPacking, sharesSpheresBySurface) {
  PackingConfig config;
  config.max_spheres = 101;
  const LinkGeometry geometry = {element(Box{{1, 1, 1}}), element(Sphere{5}),
                                 element(Box{{0.5, 0.5, 0.5}}), element(Box{{1e-6, 1e-6, 1e-6}})};
  const auto configs = element_configs(geometry, config);
  EXPECT_EQ(configs[0].max_spheres, 79);  // 6 of 7.5 m^2, of the 100 that the sphere leaves
  EXPECT_EQ(configs[1].max_spheres, 1);
  EXPECT_EQ(configs[2].max_spheres, 19);
  EXPECT_EQ(configs[3].max_spheres, 1);
  for (const PackingConfig& one : configs) EXPECT_EQ(one.max_error, config.max_error);
  EXPECT_EQ(element_configs({geometry[0]}, config)[0].max_spheres, 101);
}

TEST(LinkPacking, everyPrefixPacksTheWholeLink) {
  const LinkGeometry geometry = {element(Box{{0.1, 0.1, 0.1}}, {0.2, 0, 0}),
                                 element(test::torus(0.1, 0.03, 48, 24), {-0.2, 0, 0})};
  const Packing box = pack_element(geometry[0].shape, {});
  const Packing ring = pack_element(geometry[1].shape, {});
  const Packing all = combine(geometry, {&box, &ring});
  ASSERT_EQ(all.spheres.size(), box.spheres.size() + ring.spheres.size());
  EXPECT_GT(all.spheres[0].center.x(), 0.0);
  EXPECT_LT(all.spheres[1].center.x(), 0.0);
  for (const double share : {0.1, 0.3, 0.7}) {
    const auto prefix = static_cast<std::size_t>(share * static_cast<double>(all.spheres.size()));
    const auto of_box = std::count_if(
        all.spheres.begin(), all.spheres.begin() + static_cast<std::ptrdiff_t>(prefix),
        [](const InnerSphere& sphere) { return sphere.center.x() > 0.05; });
    EXPECT_NEAR(static_cast<double>(of_box), share * static_cast<double>(box.spheres.size()), 2.0);
  }
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

TEST(RobotModelPanda, packsAllElevenLinks) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const std::string package = test::franka_package(*data);
  std::ifstream file(package + "/robots/panda.urdf");
  std::stringstream urdf;
  urdf << file.rdbuf();
  const RobotDescription description = parse_urdf(
      urdf.str(), GeometrySource::kVisual,
      [&](const std::string& name) { return name == "franka_description" ? package : ""; });
  RobotModelConfig config;
  config.packing.max_error = test::packed_to(config.packing.max_error);
  const auto model = build_robot_model(description, config);
  ASSERT_EQ(model->links.size(), 11U);
  for (const LinkModel& l : model->links) {
    EXPECT_TRUE(l.usable()) << l.error;
    EXPECT_TRUE(l.packing.certificate.reached) << l.name;
    EXPECT_LE(l.packing.certificate.max_gap, config.packing.max_error) << l.name;
    EXPECT_GE(l.packing.spheres.size(), test::kSanitized ? 1U : 10U) << l.name;
    EXPECT_LE(l.packing.spheres.size(), 20000U) << l.name;
  }
}

}  // namespace
}  // namespace ist
