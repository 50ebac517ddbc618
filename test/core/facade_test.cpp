#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/facade/robot.h"
#include "support/demo_arm.h"
#include "support/errors.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

RobotConfig demo_config() {
  RobotConfig config;
  config.packing.max_error = test::packed_to(config.packing.max_error);
  config.find_package = [](const std::string&) { return std::string(IST_PROXIMITY_SOURCE_DIR); };
  return config;
}

const Robot& demo() {
  static const Robot robot(std::string(IST_PROXIMITY_SOURCE_DIR) + "/demo/demo_arm.urdf",
                           demo_config());
  return robot;
}

std::vector<Eigen::Vector3f> random_points(test::Rng* rng, std::size_t count) {
  std::vector<Eigen::Vector3f> points;
  for (std::size_t i = 0; i < count; ++i) {
    points.emplace_back((test::random_vector(rng, 0.9) + Eigen::Vector3d(0, 0, 0.5)).cast<float>());
  }
  return points;
}

std::vector<double> random_configurations(test::Rng* rng, std::size_t count) {
  std::vector<double> q;
  for (std::size_t i = 0; i < count * demo().joints().size(); ++i) {
    q.push_back(test::uniform(rng, -1.5, 1.5));
  }
  return q;
}

void expect_same(const LinkProximity& a, const LinkProximity& b) {
  EXPECT_EQ(a.state, b.state);
  if (a.state == LinkState::kUnknown || b.state == LinkState::kUnknown) return;
  // Another history may end the search elsewhere within the tolerance.
  EXPECT_LE(a.lower_bound, b.distance);
  EXPECT_LE(b.lower_bound, a.distance);
}

// Answers of the facade hold against brute force over the exact geometry of every link.
TEST(Facade, DistancesAreThoseOfBruteForce) {
  test::Rng rng(1);
  const std::vector<Eigen::Vector3f> points = random_points(&rng, 300);
  const Obstacles obstacles(points);
  ASSERT_EQ(obstacles.size(), points.size());
  const std::vector<double> q = random_configurations(&rng, 20);
  const std::size_t joints = demo().joints().size(), links = demo().links().size();
  QueryConfig exact;
  exact.tolerance = 0.0;
  for (std::size_t k = 0; k < 20; ++k) {
    const Span<const double> one(q.data() + k * joints, joints);
    const std::vector<LinkProximity> answers = demo().distances(one, obstacles, exact);
    const LinkPoses poses = demo().link_poses(one);
    ASSERT_EQ(answers.size(), links);
    double smallest = exact.max_distance;
    for (std::size_t i = 0; i < links; ++i) {
      double truth = exact.max_distance;
      for (const Eigen::Vector3f& p : points) {
        const Eigen::Vector3d p_L = poses.X_FL[i].inverse() * p.cast<double>();
        truth = std::min(truth, demo().model()->links[i].solid.signed_distance(p_L).distance);
      }
      smallest = std::min(smallest, truth);
      if (answers[i].state == LinkState::kClear) {
        EXPECT_EQ(truth, exact.max_distance);
      } else {
        EXPECT_NEAR(answers[i].distance, truth, 1e-6) << demo().links()[i];
      }
    }
    EXPECT_NEAR(demo().nearest(one, obstacles, exact).nearest.distance, smallest, 1e-6);
  }
}

TEST(Facade, BatchesAnswerAsSingleCallsDo) {
  test::Rng rng(2);
  const Obstacles obstacles(random_points(&rng, 500));
  const std::size_t n = 50, joints = demo().joints().size(), links = demo().links().size();
  const std::vector<double> q = random_configurations(&rng, n);
  for (const int threads : {1, 3}) {
    BatchConfig config;
    config.threads = threads;
    const std::vector<LinkProximity> all = demo().distances_batch(q, obstacles, config);
    const std::vector<RobotProximity> nearest = demo().nearest_batch(q, obstacles, config);
    ASSERT_EQ(all.size(), n * links);
    ASSERT_EQ(nearest.size(), n);
    std::vector<Eigen::Isometry3d> X_FL;
    for (std::size_t k = 0; k < n; ++k) {
      const Span<const double> one(q.data() + k * joints, joints);
      const std::vector<LinkProximity> answers = demo().distances(one, obstacles);
      for (std::size_t i = 0; i < links; ++i) expect_same(all[k * links + i], answers[i]);
      const RobotProximity single = demo().nearest(one, obstacles);
      expect_same(nearest[k].nearest, single.nearest);
      for (const Eigen::Isometry3d& X : demo().link_poses(one).X_FL) X_FL.push_back(X);
    }
    const std::vector<LinkProximity> at = demo().distances_at(X_FL, obstacles, config);
    ASSERT_EQ(at.size(), all.size());
    for (std::size_t i = 0; i < at.size(); ++i) expect_same(at[i], all[i]);
  }
}

TEST(Facade, OneRobotServesSeveralThreads) {
  test::Rng rng(3);
  const Obstacles obstacles(random_points(&rng, 200));
  const std::vector<double> q = random_configurations(&rng, 16);
  const std::vector<LinkProximity> expected = demo().distances_batch(q, obstacles);
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      const std::vector<LinkProximity> answers = demo().distances_batch(q, obstacles);
      for (std::size_t i = 0; i < answers.size(); ++i) expect_same(answers[i], expected[i]);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

TEST(Facade, BytesHoldTheWholeRobot) {
  const std::string bytes = demo().to_bytes();
  const Robot copy = Robot::from_bytes(bytes);
  EXPECT_EQ(copy.to_bytes(), bytes);
  EXPECT_EQ(copy.links(), demo().links());
  EXPECT_EQ(copy.joints(), demo().joints());
  EXPECT_EQ(copy.upper_limits(), demo().upper_limits());
  test::Rng rng(4);
  const Obstacles obstacles(random_points(&rng, 400));
  const std::vector<double> q = random_configurations(&rng, 10);
  BatchConfig config;
  config.threads = 1;
  const auto a = Robot(demo()).distances_batch(q, obstacles, config);
  const auto b = copy.distances_batch(q, obstacles, config);
  for (std::size_t i = 0; i < a.size(); ++i) expect_same(a[i], b[i]);
}

TEST(Facade, DamagedBytesAreRefused) {
  const std::string bytes = demo().to_bytes();
  test::Rng rng(5);
  test::expect_says(test::error_of([&] { Robot::from_bytes(""); }), "they are too few");
  for (int i = 0; i < 30; ++i) {
    std::string damaged = bytes;
    const auto at = std::uniform_int_distribution<std::size_t>(0, bytes.size() - 1)(rng);
    if (i % 2 == 0) {
      damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    } else {
      damaged.resize(at);
    }
    test::expect_says(test::error_of([&] { Robot::from_bytes(damaged); }), "cannot be read");
  }
}

// A finger that follows another one, along x; the other one moves along y, out of the way.
TEST(Facade, AStatedMimicJointCounts) {
  const std::string ball = "<collision><geometry><sphere radius='0.05'/></geometry></collision>";
  const auto slide = [](const std::string& name, const std::string& axis, const std::string& more) {
    return "<joint name='" + name + "' type='prismatic'><parent link='hand'/><child link='" + name +
           "_link'/><axis xyz='" + axis +
           "'/><limit lower='-1' upper='1' velocity='1' effort='1'/>" + more + "</joint>";
  };
  const Robot hand(
      "<robot name='hand'><link name='hand'/><link name='left_link'>" + ball +
      "</link><link name='right_link'>" + ball + "</link>" + slide("left", "0 1 0", "") +
      slide("right", "1 0 0", "<mimic joint='left' multiplier='2' offset='-0.1'/>") + "</robot>");
  ASSERT_EQ(hand.joints(), std::vector<std::string>{"left"});
  const std::size_t right = hand.links()[0] == "right_link" ? 0 : 1;
  const Obstacles obstacles(std::vector<Eigen::Vector3f>{{0.5F, 0.0F, 0.0F}});
  QueryConfig exact;
  exact.tolerance = 0.0;
  const auto distance = [&](const std::map<std::string, double>& positions) {
    const std::vector<double> q = hand.configuration(positions);
    const LinkProximity answer = hand.distances(q, obstacles, exact)[right];
    const RobotProximity nearest = hand.nearest(q, obstacles, exact);
    if (answer.state == LinkState::kUnknown) {
      EXPECT_EQ(nearest.nearest.lower_bound, -std::numeric_limits<double>::infinity());
      EXPECT_FALSE(hand.link_poses(q).known[right]);
      return kNaN;
    }
    EXPECT_NEAR(nearest.nearest.distance, answer.distance, 1e-6);
    EXPECT_NEAR(hand.link_poses(q).X_FL[right].translation().x() + answer.distance, 0.45, 1e-6);
    return answer.distance;
  };
  // 0.5 - 0.05 - x, with x = 2 * 0.1 - 0.1 where it follows.
  EXPECT_NEAR(distance({{"left", 0.1}}), 0.35, 1e-6);
  EXPECT_NEAR(distance({{"left", 0.1}, {"right", 0.3}}), 0.15, 1e-6);
  EXPECT_NEAR(distance({{"left", kNaN}, {"right", 0.3}}), 0.15, 1e-6);
  EXPECT_TRUE(std::isnan(distance({{"left", 0.1}, {"right", kNaN}})));
  EXPECT_TRUE(std::isnan(distance({{"left", kNaN}})));
  EXPECT_NEAR(distance({{"left", 0.1}}), 0.35, 1e-6);
}

TEST(Facade, WrongArgumentsAreNamed) {
  const Obstacles obstacles(std::vector<Eigen::Vector3f>{{0.5F, 0.0F, 0.5F}});
  const std::vector<double> q(demo().joints().size(), 0.0), short_q(2, 0.0);
  using test::expect_says;
  expect_says(test::argument_error([&] { demo().distances(short_q, obstacles); }),
              "2 positions were given");
  expect_says(test::argument_error([&] { demo().distances_batch(short_q, obstacles); }),
              "2 numbers were given");
  expect_says(test::argument_error([&] {
                demo().configuration({{"no_joint", 0.0}});
              }),
              "no joint 'no_joint'");
  QueryConfig config;
  config.tolerance = -1.0;
  expect_says(test::argument_error([&] { demo().distances(q, obstacles, config); }), "tolerance");
  config = QueryConfig();
  config.max_distance = kNaN;
  expect_says(test::argument_error([&] { demo().distances(q, obstacles, config); }),
              "max_distance");
  Eigen::Isometry3d sheared = Eigen::Isometry3d::Identity();
  sheared(0, 1) = 0.1;
  const std::vector<Eigen::Isometry3d> X_FL(demo().links().size(), sheared);
  expect_says(test::argument_error([&] { demo().distances_at(X_FL, obstacles); }), "not rigid");
  ObstaclesConfig far;
  far.min_range = 2.0;
  far.max_range = 1.0;
  EXPECT_NE(test::argument_error([&] { Obstacles(std::vector<Eigen::Vector3f>(1), far); }),
            "(no error)");
  expect_says(test::error_of([] { Robot("/no/such/robot.urdf"); }), "/no/such/robot.urdf");
  expect_says(test::error_of([] { Robot("<robot name='r'><link name='l'/></robot>"); }),
              "no usable link");
}

}  // namespace
}  // namespace ist
