// Closing speeds and times to contact beside noisy sensors. The noise of a real depth camera is
// modelled (Kinect: Nguyen, Izadi and Lovell, "Modeling Kinect Sensor Noise", 3DIMPVT 2012) on
// recorded frames where those are there, and simulated cameras have 5 mm everywhere.

#include "ist_proximity/proximity/closing_speed.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "closed_loop.h"
#include "ist_proximity/cloud/ingest.h"
#include "simulation.h"
#include "support/data_dir.h"
#include "support/demo_arm.h"
#include "support/pcd.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kCloudPeriod = 1.0 / 30.0;  // [s]

// An answer with the obstacle at a distance along x.
// Numbers of sources.
constexpr int kFront = 0, kBack = 1, kLaser = 2, kMap = 3;

LinkProximity answer_at(double distance) {
  LinkProximity result;
  result.state = LinkState::kNear;
  result.distance = result.lower_bound = distance;
  result.p_FCl = result.p_LCl = Eigen::Vector3d::Zero();
  result.p_FCo = Eigen::Vector3d(distance, 0.0, 0.0);
  result.direction = -Eigen::Vector3d::UnitX();
  return result;
}

// Feeds a standing link with one distance per cloud, four messages each.
class OneSource {
 public:
  ClosingRates cloud(double distance, int source = kFront) {
    ++generation_;
    const double stamp = time_;
    ClosingRates rates;
    for (int i = 0; i < 4; ++i) {
      rates = speed.update(time_, answer_at(distance), Eigen::Isometry3d::Identity(),
                           {source, generation_, stamp});
      if (rates.time_to_contact < 1e9) ++finite;
      if (std::isnan(rates.time_to_contact)) ++unknown;
      ++messages;
      time_ += 0.25 * kCloudPeriod;
    }
    return rates;
  }

  ClosingSpeed speed;
  int finite = 0, unknown = 0, messages = 0;

 private:
  double time_ = 10.0;
  std::uint64_t generation_ = 0;
};

// What dodge.launch told of a bolted link: at 0.171 m the nearest point changed to the other
// camera's and back, and a drop of 20 mm within one message of 5 ms became 3.93 m/s and 0.044 s.
TEST(ClosingSpeed, AnotherSourceMakesNoSpeed) {
  OneSource link;
  test::Rng rng(1);
  for (int i = 0; i < 400; ++i) {
    const bool front = rng() % 2 == 0;
    link.cloud(front ? 0.191 : 0.171, front ? kFront : kBack);
  }
  EXPECT_EQ(link.finite, 0) << "of " << link.messages;
  EXPECT_LT(link.unknown, 60);  // until each camera's fourth cloud
  // A source that was not the nearest before is not known at first.
  const ClosingRates rates = link.cloud(0.1, kLaser);
  EXPECT_TRUE(std::isnan(rates.obstacles) && std::isnan(rates.total));
  EXPECT_TRUE(std::isnan(rates.time_to_contact));
  EXPECT_NEAR(rates.robot, 0.0, 1e-12);
}

TEST(ClosingSpeed, NoiseIsNoSpeed) {
  for (const double sigma : {0.0005, 0.005, 0.02}) {
    OneSource link;
    std::mt19937_64 rng(5);
    std::normal_distribution<double> noise(0.0, sigma);
    const int clouds = test::scaled(20000);
    for (int i = 0; i < clouds; ++i) link.cloud(0.3 + noise(rng));
    EXPECT_LT(link.finite, 0.01 * link.messages) << sigma;
    std::printf("noise of %.1f mm: %.2f %% of the times to contact are finite\n", 1e3 * sigma,
                100.0 * link.finite / link.messages);
  }
}

// Steps are no speed: an obstacle appears 0.3 m nearer, and stays.
TEST(ClosingSpeed, AnObstacleThatAppearsMakesNoSpeed) {
  std::mt19937_64 rng(6);
  std::normal_distribution<double> noise(0.0, 0.003);
  int finite = 0, messages = 0;
  for (int k = 0; k < 200; ++k) {
    OneSource link;
    for (int i = 0; i < 20; ++i) link.cloud(0.6 + noise(rng));
    for (int i = 0; i < 20; ++i) link.cloud(0.3 + noise(rng));
    finite += link.finite;
    messages += link.messages;
  }
  EXPECT_LT(finite, 0.01 * messages);
}

TEST(ClosingSpeed, SlowAndFastApproachesAreMeasured) {
  for (const double speed : {0.1, 0.3, 1.0, 2.0}) {
    // A slow approach is told as soon as it is certain, when its speed is known by half.
    const double error = speed < 0.2 ? 0.6 : 0.2;
    std::mt19937_64 rng(7);
    std::normal_distribution<double> noise(0.0, 0.003);
    OneSource link;
    int checked = 0;
    for (double d = 1.5; d > 0.1; d -= speed * kCloudPeriod) {
      const ClosingRates rates = link.cloud(d + noise(rng));
      if (d > 1.2) continue;
      ++checked;
      EXPECT_NEAR(rates.obstacles, speed, error * speed) << d;
    }
    EXPECT_GT(checked, 10);
  }
}

// The robot's part alone: a link that moves toward a wall which stands, with noise; the speed of
// the robot is exact, and encoders' last bits are none.
TEST(ClosingSpeed, TheRobotsPartIsThatOfThePoses) {
  ClosingSpeed speed;
  std::mt19937_64 rng(8);
  std::normal_distribution<double> noise(0.0, 1e-6);
  const auto pose = [](double x) { return Eigen::Isometry3d(Eigen::Translation3d(x, 0.0, 0.0)); };
  ClosingRates rates;
  for (int i = 0; i < 1000; ++i) {  // at rest, at 1 kHz
    const double time = 1e-3 * i;
    const double x = noise(rng);
    rates = speed.update(time, answer_at(0.5 - x), pose(x), {kMap, 1, 0.0, true});
    if (i > 0) EXPECT_EQ(rates.time_to_contact, std::numeric_limits<double>::infinity());
  }
  for (int i = 0; i < 1000; ++i) {
    const double x = 2e-4 * i;
    rates = speed.update(1.0 + 1e-3 * i, answer_at(0.5 - x), pose(x), {kMap, 1, 0.0, true});
  }
  EXPECT_NEAR(rates.robot, 0.2, 1e-6);
  EXPECT_EQ(rates.obstacles, 0.0);  // a map file stands still
  EXPECT_NEAR(rates.time_to_contact, (0.5 - 0.1998) / 0.2, 1e-4);
}

// What has gone away from the link, and stands still now, does not slow the link's own approach.
TEST(ClosingSpeed, WhatHasStoppedHasNoSpeed) {
  OneSource wall;
  ClosingRates rates;
  for (int i = 0; i < 20; ++i) rates = wall.cloud(0.5 + 0.01 * i, kMap);
  EXPECT_NEAR(rates.obstacles, -0.01 / kCloudPeriod, 1e-6);
  rates = wall.speed.update(20.0 * kCloudPeriod, answer_at(0.69), Eigen::Isometry3d::Identity(),
                            {kMap, 20, 19.0 * kCloudPeriod, true});
  EXPECT_EQ(rates.obstacles, 0.0);
}

TEST(ClosingSpeed, LinkAgainstLink) {
  ClosingSpeed speed;
  EXPECT_TRUE(std::isnan(speed.update_pair(0.0, answer_at(0.5)).total));
  ClosingRates rates;
  for (int i = 1; i < 20; ++i) rates = speed.update_pair(0.02 * i, answer_at(0.5 - 0.006 * i));
  EXPECT_NEAR(rates.total, 0.3, 1e-9);
  EXPECT_TRUE(std::isnan(rates.robot) && std::isnan(rates.obstacles));
  EXPECT_NEAR(rates.time_to_contact, (0.5 - 0.006 * 19) / 0.3, 1e-9);
  LinkProximity contact = answer_at(-0.1);
  contact.state = LinkState::kContact;
  EXPECT_EQ(speed.update_pair(1.0, contact).time_to_contact, 0.0);
}

// By link of a model, fed with the answers of a simulation.
class Watch {
 public:
  Watch(const sim::ClosedLoopConfig& config, std::size_t cameras)
      : perception(test::demo_model(), config, cameras), speeds(test::demo_model()->links.size()) {}

  // Takes the images that have arrived, and answers.
  const std::vector<ClosingRates>& run(sim::Simulation* world) {
    perception.look(world);
    const auto& answers = perception.answer(*world);
    const std::vector<Eigen::Isometry3d> X_FL = world->link_poses();
    rates.resize(answers.size());
    for (std::size_t i = 0; i < answers.size(); ++i) {
      const auto camera = static_cast<std::size_t>(std::max(answers[i].source, 0));
      const CloudSnapshot& cloud = perception.snapshots()[camera];
      const auto generation = static_cast<std::uint64_t>(1e4 * cloud.stamp);
      rates[i] = speeds[i].update(world->time(), answers[i], X_FL[i],
                                  {static_cast<int>(camera), generation, cloud.stamp});
    }
    return rates;
  }

  sim::Perception perception;
  std::vector<ClosingSpeed> speeds;
  std::vector<ClosingRates> rates;
};

// A ball flies at the gripper at 1 m/s. The truth is the exact distance over the speed at which it
// falls, at the time of the message; images are 50 to 83 ms old. Where the two cameras take turns
// to see the nearest point, the speed is not known until the new one's fourth image.
TEST(ClosingSpeedInScenes, ABallAtOneMetrePerSecond) {
  const RobotDescription robot = test::demo_robot();
  sim::ClosedLoopConfig config;
  int checked = 0, unknown = 0, wrong = 0;
  double worst = 0.0;
  const Eigen::Vector3d ways[] = {{0.8, 0.9, 0.2}, {0.9, -0.8, 0.3}, {1.1, 0.1, 0.25}};
  for (std::uint64_t seed = 0; seed < 3; ++seed) {
    sim::Obstacle ball;  // alone: bench and floor would be nearer at first
    ball.name = "ball";
    ball.shape = Sphere{0.06};
    sim::Arm arm(robot, sim::demo_arm());
    Eigen::VectorXd q(6);
    q << 0.0, 0.4, 1.0, 0.0, 0.3, 0.0;
    std::size_t gripper = 0;
    while (robot.links[gripper].name != "gripper_link") ++gripper;
    ball.to = arm.link_poses(q)[gripper].translation();
    ball.from = ball.to + 1.5 * ways[seed].normalized();
    ball.start = 0.3;
    ball.speed = 1.0;
    sim::Simulation world(robot, sim::demo_arm(), {ball}, sim::demo_cameras(), seed);
    world.arm().reset(q);
    Watch watch(config, world.cameras().size());
    double before = 0.0;  // [m] the distance a step ago
    for (auto truth = world.nearest(2.0); truth.distance > 0.1; truth = world.nearest(2.0)) {
      before = truth.distance;
      world.step(Eigen::VectorXd::Zero(6));
      if (std::lround(1e3 * world.time()) % 5 != 0) continue;
      const auto& rates = watch.run(&world);
      const auto now = world.nearest(2.0);
      if (now.distance > 0.5) continue;
      const double speed = (before - now.distance) / sim::Simulation::kStep;
      if (speed < 0.9) continue;  // it flies past the nearest point
      const double time = now.distance / speed;
      const double estimate = rates[now.link].time_to_contact;
      ++checked;
      if (std::isnan(estimate)) {
        ++unknown;
        continue;
      }
      const double error = std::abs(estimate / time - 1.0);
      wrong += error <= 0.2 ? 0 : 1;
      worst = std::max(worst, error);
    }
  }
  std::printf("%d messages: %d unknown, %d wrong, worst error %.1f %%\n", checked, unknown, wrong,
              100.0 * worst);
  EXPECT_GT(checked, 200);
  EXPECT_LT(unknown, checked / 5);
  EXPECT_EQ(wrong, 0);
}

// The frame with noise and the steps of a Kinect's disparity.
void add_kinect_noise(const std::vector<Eigen::Vector3f>& frame, test::Rng* rng,
                      std::vector<Eigen::Vector3f>* noisy) {
  std::normal_distribution<double> normal;
  for (std::size_t i = 0; i < frame.size(); ++i) {
    const double z = frame[i].z();
    if (!(z > 0.0)) continue;
    const double sigma = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);
    // Disparity comes in steps of 1/8 pixel: 2.85 mm at 1 m, growing with the square.
    const double inverse_step = 0.00285;
    const double measured =
        1.0 / (inverse_step * std::round(1.0 / (z + sigma * normal(*rng)) / inverse_step));
    (*noisy)[i] = frame[i] * static_cast<float>(measured / z);
  }
}

// Spheres that stand 0.1 to 0.6 m from what a real Kinect saw, whose noise is drawn anew for each
// frame: axial noise of 1.2 mm + 1.9 mm/m^2 (z - 0.4 m)^2, and the steps of its disparity.
TEST(ClosingSpeedInScenes, StaticLinksBesideAKinect) {
  const auto data = test::data_dir();
  if (!data) GTEST_SKIP() << test::kNoData;
  const std::vector<Eigen::Vector3f> frame =
      test::read_pcd((*data / "clouds" / "mosd0.pcd").string());
  const auto model = test::make_model(std::vector<Shape>(24, Sphere{0.05}), 0.005);
  test::Rng rng(4);
  std::vector<Eigen::Isometry3d> X_FL;
  while (X_FL.size() < model->links.size()) {
    const Eigen::Vector3f& p = frame[rng() % frame.size()];
    if (!p.allFinite()) continue;
    const Eigen::Vector3d q = p.cast<double>();
    X_FL.emplace_back(Eigen::Translation3d(q * (1.0 - test::uniform(&rng, 0.15, 0.65) / q.norm())));
  }
  const std::vector<bool> known(X_FL.size(), true);
  IngestConfig ingest_config;
  ingest_config.self_filter = false;
  Ingest ingest(ingest_config);
  CloudSnapshot snapshot;
  ProximityQuery query(model, {});
  std::vector<ClosingSpeed> speeds(X_FL.size());
  std::vector<LinkProximity> answers;
  std::vector<Eigen::Vector3f> noisy = frame;
  int messages = 0, finite = 0, unknown = 0;
  const int frames = test::scaled(300);
  for (int k = 0; k < frames; ++k) {
    add_kinect_noise(frame, &rng, &noisy);
    RawCloud raw = packed_cloud(noisy.data()->data(), 640, noisy.size() / 640);
    const double stamp = k * kCloudPeriod;
    ingest.run(raw, Eigen::Isometry3d::Identity(), {}, stamp, &snapshot);
    for (int m = 0; m < 2; ++m) {
      query.run(X_FL, known, {&snapshot}, &answers);
      for (std::size_t i = 0; i < answers.size(); ++i) {
        const ClosingRates rates = speeds[i].update(stamp + 0.01 + 0.01 * m, answers[i], X_FL[i],
                                                    {kFront, static_cast<std::uint64_t>(k), stamp});
        if (answers[i].state != LinkState::kNear || k < 8) continue;
        ++messages;
        finite += std::isfinite(rates.time_to_contact) ? 1 : 0;
        unknown += std::isnan(rates.time_to_contact) ? 1 : 0;
      }
    }
  }
  std::printf("%d messages: %.2f %% finite, %.2f %% unknown\n", messages, 100.0 * finite / messages,
              100.0 * unknown / messages);
  EXPECT_GT(messages, frames);
  EXPECT_LE(finite, 0.01 * messages);
  EXPECT_LE(unknown, 0.02 * messages);
}

}  // namespace
}  // namespace ist
