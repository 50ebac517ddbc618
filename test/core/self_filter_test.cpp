#include "cloud/filters/self_filter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <random>
#include <set>
#include <string>

#include "internal/robot/coarse_hulls.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/facade/robot.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/allocations.h"
#include "support/distance_fields.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

// The packing is coarse, so that the exact geometry has to decide for many points between inner and
// cover spheres.
RobotModel coarse_robot() {
  return *test::make_model(
      {Box{{0.3, 0.2, 0.1}}, Cylinder{0.08, 0.4}, Sphere{0.12}, test::l_shape(0.3, 0.12)}, 0.02);
}

// A robot at its poses.
struct PosedRobot {
  const RobotModel* model;
  std::vector<Eigen::Isometry3d> X_FL;
  std::vector<bool> known;

  std::vector<PosedSolid> solids() const { return posed_solids(*model, X_FL, known); }
};

PosedRobot posed(const RobotModel& model, const Eigen::Vector3d& base = Eigen::Vector3d::Zero()) {
  PosedRobot robot{&model, {}, std::vector<bool>(model.links.size(), true)};
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const auto number = static_cast<double>(i);
    robot.X_FL.push_back(test::at(base + Eigen::Vector3d(0.0, 0.25 * number, 0.1)) *
                         Eigen::AngleAxisd(0.4 + number, Eigen::Vector3d(1, 2, 3).normalized()));
  }
  return robot;
}

// Smallest signed distance [m] to the links whose pose is known.
double exact_distance(const PosedRobot& robot, const Eigen::Vector3d& p_F) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < robot.model->links.size(); ++i) {
    if (!robot.known[i]) continue;
    const Eigen::Vector3d p_L = robot.X_FL[i].inverse() * p_F;
    nearest = std::min(nearest, robot.model->links[i].solid.signed_distance(p_L).distance);
  }
  return nearest;
}

std::vector<Eigen::Vector3f> cloud_about_the_robot(std::size_t n) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> u(-0.5F, 0.5F);
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < n; ++i) {
    const float x = u(random), y = 0.25F + 1.2F * u(random), z = 0.1F + u(random);
    points.emplace_back(x, y, z);
  }
  return points;
}

RawCloud raw_of(const std::vector<Eigen::Vector3f>& points) {
  return packed_cloud(points.data()->data(), points.size(), 1);
}

// Runs a cloud that is given in the frame of a sensor at `base`.
CloudSnapshot ingest(const std::vector<Eigen::Vector3f>& points, const PosedRobot& robot,
                     const IngestConfig& config,
                     const Eigen::Vector3d& base = Eigen::Vector3d::Zero()) {
  CloudSnapshot snapshot;
  Ingest(config).run(raw_of(points), test::at(base), robot.solids(), 0.0, &snapshot);
  const IngestCounts& counts = snapshot.counts;
  EXPECT_EQ(counts.received, counts.not_a_number + counts.infinite + counts.out_of_range +
                                 counts.on_robot + counts.used);
  return snapshot;
}

IngestConfig config_with(double padding) {
  IngestConfig config;
  config.min_range = 0.0;
  config.self_filter_padding = padding;
  return config;
}

// Exactly the points within the padding are dropped; rounding decides within a micrometre.
// @returns how many are
std::size_t expect_same_as_exact(const std::vector<Eigen::Vector3f>& points,
                                 const PosedRobot& robot, double padding,
                                 const Eigen::Vector3d& base = Eigen::Vector3d::Zero()) {
  const CloudSnapshot snapshot = ingest(points, robot, config_with(padding), base);
  const std::set<std::uint32_t> kept = test::ids_of(snapshot.index);
  std::size_t dropped = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance = exact_distance(robot, base + points[i].cast<double>());
    const bool is_kept = kept.count(static_cast<std::uint32_t>(i)) > 0;
    dropped += is_kept ? 0 : 1;
    if (std::abs(distance - padding) < 1e-6) continue;
    EXPECT_EQ(is_kept, distance > padding) << "point " << i << " at " << distance << " m";
  }
  EXPECT_EQ(snapshot.counts.on_robot, dropped);
  return dropped;
}

void expect_exact(const std::vector<Eigen::Vector3f>& points, const PosedRobot& robot,
                  double padding, const Eigen::Vector3d& base = Eigen::Vector3d::Zero()) {
  const std::size_t dropped = expect_same_as_exact(points, robot, padding, base);
  EXPECT_GT(dropped, points.size() / 100);
  EXPECT_LT(dropped, points.size() / 2);
}

const Eigen::Vector3d kFarAwayBase(691000.25, 5334000.5, 520.75);  // [m] as of a map

TEST(SelfFilter, agreesWithExactDistance) {
  const RobotModel model = coarse_robot();
  const std::vector<Eigen::Vector3f> points = cloud_about_the_robot(30000);
  for (const double padding : {0.0, 0.001, 0.02, 0.1}) {
    SCOPED_TRACE(padding);
    expect_exact(points, posed(model), padding);
  }
}

TEST(SelfFilter, agreesWithExactDistanceFarFromTheFixedFramesOrigin) {
  const RobotModel model = coarse_robot();
  expect_exact(cloud_about_the_robot(10000), posed(model, kFarAwayBase), 0.02, kFarAwayBase);
}

// A field of distances decides most of a tile's points, and none of them otherwise than the exact
// geometry does: also of meshes with holes and of links of several elements.
TEST(SelfFilter, agreesWithExactDistanceWhereThereAreFields) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    test::Rng rng(seed);
    const auto model = test::with_fields(test::model_of(test::random_links(&rng), 0.02));
    PosedRobot robot = posed(*model);
    ASSERT_NE(robot.solids().front().field, nullptr);
    for (std::size_t i = 0; i < robot.X_FL.size(); ++i) {
      robot.known.assign(robot.known.size(), false);
      robot.known[i] = true;
      const Eigen::Vector3d base = seed == 3 ? kFarAwayBase : Eigen::Vector3d::Zero();
      robot.X_FL[i].translation() = base + Eigen::Vector3d(0.0, 0.25, 0.1);
      const std::vector<Eigen::Vector3f> points = cloud_about_the_robot(6000);
      for (const double padding : {0.0, 0.005, 0.02, 0.1}) {
        SCOPED_TRACE(model->links[i].name + ", seed " + std::to_string(seed) + ", padding " +
                     std::to_string(padding));
        expect_same_as_exact(points, robot, padding, base);
      }
    }
  }
}

TEST(SelfFilter, linkOfUnknownPoseDropsNothing) {
  const RobotModel model = coarse_robot();
  PosedRobot robot = posed(model);
  robot.known[1] = false;
  robot.X_FL[1].matrix().setConstant(std::nan(""));
  expect_exact(cloud_about_the_robot(10000), robot, 0.02);
  robot.known.assign(3, false);
  EXPECT_EQ(ingest(cloud_about_the_robot(1000), robot, config_with(0.02)).counts.on_robot, 0U);
}

TEST(SelfFilter, linkWithoutGeometryDropsNothing) {
  RobotModel model = coarse_robot();
  model.links[0].error = "no mesh";
  model.links[2] = LinkModel();
  PosedRobot robot = posed(model);
  const CloudSnapshot snapshot = ingest(cloud_about_the_robot(5000), robot, config_with(0.02));
  robot.known[0] = robot.known[2] = false;
  const CloudSnapshot expected = ingest(cloud_about_the_robot(5000), robot, config_with(0.02));
  EXPECT_EQ(test::ids_of(snapshot.index), test::ids_of(expected.index));
  EXPECT_GT(snapshot.counts.on_robot, 0U);
}

// A depth image of a wall through the robot, with holes: squares of pixels are decided by their
// boxes where that is possible. The answer is that of each point, also in the counts.
TEST(SelfFilter, anImageIsDecidedByItsBoxes) {
  constexpr std::size_t kWidth = 320, kHeight = 240;
  const RobotModel model = coarse_robot();
  const PosedRobot robot = posed(model);
  const Eigen::Isometry3d X_FS = test::at(0.1, 0.2, -1.0);
  std::mt19937 random(5);
  std::size_t holes = 0;
  const auto image = std::make_shared<std::vector<float>>();
  for (std::size_t i = 0; i < kWidth * kHeight; ++i) {
    const float u = static_cast<float>(i % kWidth) / 160.0F - 1.0F,
                v = static_cast<float>(i / kWidth) / 160.0F - 0.75F;
    const bool is_hole = (u > 0.2F && u < 0.25F) || random() % 100 == 0;
    const float depth = is_hole ? std::nanf("") : 1.1F + 0.3F * u;
    image->insert(image->end(), {u * depth, v * depth, depth, 0.0F});
    holes += is_hole ? 1 : 0;
  }
  RawCloud raw = packed_cloud(image->data(), kWidth, kHeight, 4);
  raw.owner = image;
  for (const double padding : {0.0, 0.02, 0.1}) {
    SCOPED_TRACE(padding);
    CloudSnapshot snapshot;
    Ingest(config_with(padding)).run(raw, X_FS, robot.solids(), 0.0, &snapshot);
    const IngestCounts& counts = snapshot.counts;
    EXPECT_EQ(counts.not_a_number, holes);
    EXPECT_EQ(counts.received, counts.not_a_number + counts.on_robot + counts.used);
    const std::set<std::uint32_t> kept = test::ids_of(snapshot.index);
    EXPECT_EQ(counts.used, kept.size());
    for (std::size_t i = 0; i < kWidth * kHeight; i += 3) {
      const Eigen::Vector3f p_S(&(*image)[4 * i]);
      if (!p_S.allFinite()) continue;
      const double distance = exact_distance(robot, X_FS * p_S.cast<double>());
      if (std::abs(distance - padding) < 1e-6) continue;
      ASSERT_EQ(kept.count(static_cast<std::uint32_t>(i)) > 0, distance > padding)
          << "pixel " << i << " at " << distance << " m";
    }
    EXPECT_GT(counts.on_robot, counts.received / 200);
  }
}

// The robot comes from far away, where no part of the cloud is looked at, to where points are
// dense.
TEST(SelfFilter, aRobotThatComesNearAllocatesNothing) {
  const RobotModel model = coarse_robot();
  std::vector<Eigen::Vector3f> points = cloud_about_the_robot(40000);
  for (std::size_t i = 0; i < points.size(); i += 2) points[i] *= 0.1F;
  const Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();
  IngestConfig config = config_with(0.02);
  config.search_distance = 0.1;
  Ingest ingest(config);
  CloudSnapshot snapshot;
  const auto run = [&](double x, double stamp) {
    ingest.run(raw_of(points), X_FS, posed(model, {x, 0.0, 0.0}).solids(), stamp, &snapshot);
  };
  run(9.0, 0.0);
  run(9.0, 0.03);
  for (int k = 0; k < 10; ++k) {
    const PosedRobot robot = posed(model, {1.0 - 0.1 * k, 0.0, 0.0});
    const std::vector<PosedSolid> solids = robot.solids();
    const long before = test::allocations;
    ingest.run(raw_of(points), X_FS, solids, 0.06 + 0.03 * k, &snapshot);
    EXPECT_EQ(test::allocations - before, 0) << "step " << k;
  }
  EXPECT_GT(snapshot.counts.on_robot, 0U);
}

// A link (a capsule, but for its ends), the capsule for planning about it, and what is no hull: a
// hand about its finger, a mark in a link, a shape beside a link, what a joint moves.
std::string urdf_with_hull() {
  const auto link = [](const std::string& name, const std::string& shape, double z = 0.0) {
    return "<collision><origin xyz='0 0 " + std::to_string(z) + "'/><geometry>" + shape +
           "</geometry></collision>" + (name.empty() ? "" : "</link>");
  };
  const auto joint = [](const std::string& parent, const std::string& child,
                        const std::string& type = "fixed", const std::string& xyz = "0 0 0") {
    return "<joint name='to_" + child + "' type='" + type + "'><parent link='" + parent +
           "'/><child link='" + child + "'/><origin xyz='" + xyz +
           "'/><limit lower='0' upper='1' effort='1' velocity='1'/></joint>";
  };
  const auto begin = [](const std::string& name) { return "<link name='" + name + "'>"; };
  const std::string fine = "<cylinder radius='0.05' length='0.3'/>",
                    ball = "<sphere radius='0.1'/>";
  return "<robot name='r'>" + begin("arm") + link("arm", fine) + begin("arm_sc") +
         link("", "<cylinder radius='0.1' length='0.3'/>") + link("", ball, 0.15) +
         link("arm_sc", ball, -0.15) + begin("hand") + link("hand", "<box size='0.3 0.3 0.3'/>") +
         begin("finger") + link("finger", "<box size='0.2 0.2 0.2'/>") + begin("mark") +
         link("mark", "<sphere radius='0.001'/>") + begin("ball") + link("ball", ball) +
         begin("beside") + link("beside", "<sphere radius='0.15'/>") + begin("moved") +
         link("moved", "<sphere radius='0.2'/>") + joint("arm", "arm_sc") +
         joint("arm", "hand", "revolute", "0 0 5") + joint("hand", "finger") +
         joint("finger", "mark") + joint("arm", "ball", "revolute", "0 5 0") +
         joint("ball", "beside", "fixed", "0 0.2 0") + joint("ball", "moved", "revolute") +
         "</robot>";
}

TEST(SelfFilter, NothingBetweenALinkAndACoarseHullIsDropped) {
  const RobotDescription description = parse_urdf(urdf_with_hull(), GeometrySource::kCollision, {});
  const std::vector<CoarseHull> hulls = coarse_hulls(description, {});
  ASSERT_EQ(hulls.size(), 1U);
  EXPECT_EQ(hulls[0].link, "arm_sc");
  EXPECT_EQ(hulls[0].enclosed, "arm");
  EXPECT_TRUE(hulls[0].is_below);
  int asked = 0;
  EXPECT_THROW(coarse_hulls(description, [&] { return ++asked == 4; }), Cancelled)
      << "after each of the two links and before the search";
  RobotModelConfig model_config;
  model_config.links = {"arm", "arm_sc"};
  const auto model = build_robot_model(description, model_config, {});
  ASSERT_EQ(model->links.size(), 2U);
  PosedRobot robot = posed(*model);
  robot.X_FL.assign(2, Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < 2; ++i) robot.known[i] = model->links[i].name != hulls[0].link;
  std::vector<Eigen::Vector3f> points;
  std::vector<float> distances;
  for (const float d : {0.0F, 0.01F, 0.019F, 0.021F, 0.03F, 0.04F, 0.05F, 0.06F, 0.07F}) {
    for (int i = 0; i < 20; ++i) {
      const float angle = 0.3F * static_cast<float>(i), z = 0.01F * static_cast<float>(i - 10);
      points.emplace_back((0.05F + d) * std::cos(angle), (0.05F + d) * std::sin(angle), z);
      distances.push_back(d);
    }
  }
  const auto expect_dropped = [&](const CloudSnapshot& snapshot, float padding) {
    const std::set<std::uint32_t> kept = test::ids_of(snapshot.index);
    for (std::uint32_t i = 0; i < points.size(); ++i) {
      EXPECT_EQ(kept.count(i) > 0, distances[i] > padding) << distances[i] << " m";
    }
  };
  expect_dropped(ingest(points, robot, config_with(0.02)), 0.02F);
  const Robot loaded(urdf_with_hull());
  ObstaclesConfig config;
  config.robot = &loaded;
  config.q.assign(loaded.joints().size(), 0.0);
  EXPECT_EQ(Obstacles(points, config).counts().on_robot, 60U);
  // A padding of the link's own.
  const std::vector<PosedSolid> solids = robot.solids();
  ASSERT_EQ(solids.size(), 1U);
  for (const double padding : {0.005, 0.045}) {
    CloudSnapshot snapshot;
    Ingest(config_with(0.02))
        .run(raw_of(points), Eigen::Isometry3d::Identity(), solids, 0.0, &snapshot, {&padding, 1});
    expect_dropped(snapshot, static_cast<float>(padding));
  }
}

}  // namespace
}  // namespace ist
