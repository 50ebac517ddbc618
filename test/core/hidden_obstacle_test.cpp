// An obstacle that something hides from the only camera, by the simulation's true shapes:
// remembered, forgotten after the decay, and measured again. Without memory the arm is told that
// nothing is near.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "closed_loop.h"
#include "support/demo_arm.h"

namespace ist {
namespace {

constexpr double kHiddenFrom = 1.0, kHiddenUntil = 5.0, kDecay = 2.0;  // [s]

// The front camera of the demonstration, a ball beside the gripper, and a board that comes before
// the camera for a while.
struct World {
  World() {
    sim::DepthCameraConfig camera = sim::demo_cameras()[0];
    std::vector<sim::Obstacle> obstacles = sim::demo_surroundings();
    sim::Obstacle ball, board;
    ball.name = "ball";
    ball.shape = Sphere{0.06};
    sim::Arm arm(robot, sim::demo_arm());
    const std::vector<Eigen::Isometry3d> X_FL = arm.link_poses(arm.positions());
    for (std::size_t i = 0; i < robot.links.size(); ++i) {
      if (robot.links[i].name == "gripper_link") ball.from = X_FL[i].translation();
    }
    ball.from += Eigen::Vector3d(0.18, -0.12, 0.0);  // towards the camera
    board.name = "board";
    board.shape = Box{{0.5, 0.4, 0.02}};
    board.R_FO = camera.X_FC.linear();
    board.path = [X_FC = camera.X_FC](double time) -> Eigen::Vector3d {
      const bool hides = time >= kHiddenFrom && time < kHiddenUntil;
      return X_FC * Eigen::Vector3d(0.0, hides ? 0.0 : -0.9, 0.3);
    };
    obstacles.push_back(ball);
    obstacles.push_back(board);
    cameras = {camera};
    simulation = std::make_unique<sim::Simulation>(robot, sim::demo_arm(), obstacles, cameras, 1);
    still =
        Eigen::VectorXd::Zero(static_cast<Eigen::Index>(simulation->arm().config().joints.size()));
  }

  RobotDescription robot = test::demo_robot();
  std::vector<sim::DepthCameraConfig> cameras;
  std::unique_ptr<sim::Simulation> simulation;
  Eigen::VectorXd still;
};

struct Sample {
  double time, bound, truth;
};

// The smallest bound of the links that can move, every 50 ms, beside the true distance.
std::vector<Sample> watch(bool remember) {
  World world;
  const auto model = build_robot_model(world.robot, {});
  sim::ClosedLoopConfig config;
  config.remember = remember;
  config.memory.decay = kDecay;
  sim::Perception perception(model, config, 1);
  std::vector<Sample> samples;
  for (int step = 0; world.simulation->time() < 6.5; ++step) {
    perception.look(world.simulation.get());
    if (step % 50 == 0 && perception.has_seen()) {
      double bound = std::numeric_limits<double>::infinity();
      const auto& results = perception.answer(*world.simulation);
      for (std::size_t i = 0; i < results.size(); ++i) {
        if (world.simulation->arm().moved()[i]) bound = std::min(bound, results[i].lower_bound);
      }
      const double truth = world.simulation->nearest(10.0).distance;
      samples.push_back({world.simulation->time(), bound, truth});
    }
    world.simulation->step(world.still);
  }
  return samples;
}

constexpr double kLatency = 0.1;  // [s] an image's, and the time between two

bool is_in_view(double time) { return time < kHiddenFrom || time > kHiddenUntil + kLatency; }
bool is_hidden(double time) { return time > kHiddenFrom + kLatency && time < kHiddenUntil; }

TEST(HiddenObstacle, IsRememberedUntilTheDecayAndMeasuredAgain) {
  const std::vector<Sample> samples = watch(true);
  // The camera sees the ball's far side, so that what it measures is more than the truth.
  double nearest = std::numeric_limits<double>::infinity(), farthest = 0.0;
  int remembered = 0, forgotten = 0, seen = 0;
  for (const Sample& s : samples) {
    if (!is_in_view(s.time)) continue;
    EXPECT_NEAR(s.bound, s.truth, 0.08) << s.time;
    nearest = std::min(nearest, s.bound);
    farthest = std::max(farthest, s.bound);
    ++seen;
  }
  EXPECT_LT(farthest - nearest, 0.04) << "the noise";
  for (const Sample& s : samples) {
    if (!is_hidden(s.time)) continue;
    if (s.time < kHiddenFrom + kDecay - kLatency) {
      EXPECT_LT(s.bound, farthest) << "told farther than it was seen, at " << s.time;
      EXPECT_GT(s.bound, nearest - 0.04) << "more than a voxel's diagonal nearer, at " << s.time;
      ++remembered;
    } else if (s.time > kHiddenFrom + kDecay + kLatency) {
      EXPECT_GT(s.bound, farthest + 0.1) << "not forgotten at " << s.time;
      ++forgotten;
    }
  }
  EXPECT_GT(remembered, 20);
  EXPECT_GT(forgotten, 20);
  EXPECT_GT(seen, 30);
}

TEST(HiddenObstacle, IsToldFarWithoutMemory) {
  int hidden = 0;
  for (const Sample& s : watch(false)) {
    if (!is_hidden(s.time)) continue;
    EXPECT_GT(s.bound, s.truth + 0.1);
    ++hidden;
  }
  EXPECT_GT(hidden, 60);
}

}  // namespace
}  // namespace ist
