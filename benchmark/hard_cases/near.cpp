#include "hard_cases/near.h"

#include <algorithm>
#include <cmath>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/demo_arm.h"
#include "support/truth.h"

namespace ist::benchmark {
namespace {

constexpr std::size_t kPosesPerPart = 6, kStepsPerPose = 10;
constexpr std::size_t kStride = 167;  // recorded poses, or hundredths of a second, between parts

MovingRobot panda(const std::filesystem::path& data) {
  RobotDescription robot = test::panda_description(data);
  robot.links.erase(robot.links.begin());  // it stands still
  auto motion = recorded_motion(data, 2000);
  for (Poses& X_FL : motion) X_FL.erase(X_FL.begin());
  return {"Panda, visual meshes", robot, [motion](std::size_t number) {
            const std::size_t first = number * kStride % (motion.size() - kPosesPerPart);
            const auto begin = motion.begin() + static_cast<std::ptrdiff_t>(first);
            return interpolated({begin, begin + kPosesPerPart}, kStepsPerPose);
          }};
}

// The demo arm without the links that stand still.
// @param swing   [rad] amplitude of the joints
// @param middle  [rad] about which they swing, by joint
MovingRobot demo_arm(const std::string& name, double swing, const std::vector<double>& middle) {
  const std::vector<LinkDescription> links = test::demo_robot().links;
  RobotDescription robot;
  robot.name = "demo_arm";
  std::vector<std::size_t> moving;
  for (std::size_t i = 0; i < links.size(); ++i) {
    if (links[i].name == "base_link" || links[i].name == "stand_link") continue;
    moving.push_back(i);
    robot.links.push_back(links[i]);
  }
  return {name, robot, [=](std::size_t number) {
            constexpr double kRate = 1.5;  // [rad/s]
            std::vector<Poses> poses((kPosesPerPart - 1) * kStepsPerPose);
            for (std::size_t k = 0; k < poses.size(); ++k) {
              const double t = 0.001 * static_cast<double>(10 * number * kStride + k);
              std::vector<double> q = middle;
              for (std::size_t j = 0; j < q.size(); ++j) {
                q[j] += swing * std::sin(kRate * t + static_cast<double>(j));
              }
              const Poses all = demo_poses(q);
              for (const std::size_t i : moving) poses[k].push_back(all[i]);
            }
            return poses;
          }};
}

// Finds the height at which the nearest link is at `distance`, from `*height` on. Where the
// obstacle is below, one metre of height is `slope` metres of distance.
bool find_height(double distance, const Poses& X_FL, const CloudSnapshot& cloud,
                 ProximityQuery* query, double* height) {
  constexpr int kSteps = 40;
  constexpr double kLeastSlope = 0.3, kLargestStep = 0.1;  // [m]
  const double close = 1e-5 + 0.01 * std::abs(distance);   // [m]
  const std::vector<bool> known(X_FL.size(), true);
  RobotProximity answer;
  for (int step = 0; step < kSteps; ++step) {
    Poses raised = X_FL;
    for (Eigen::Isometry3d& X : raised) X.translation().z() += *height;
    query->run_minimum(raised, known, {&cloud}, &answer);
    if (answer.link < 0) {
      *height -= kLargestStep;
      continue;
    }
    const double miss = distance - answer.nearest.distance;
    if (std::abs(miss) <= close) return true;
    const double slope = std::max(kLeastSlope, answer.nearest.direction.z());
    *height += std::clamp(miss / slope, -kLargestStep, kLargestStep);
  }
  return false;
}

}  // namespace

std::vector<MovingRobot> moving_robots(const std::filesystem::path& data) {
  return {panda(data), demo_arm("demo arm", 0.5, {0.0, 0.9, 0.9, 0.0, 0.8, 0.0}),
          demo_arm("demo arm, level", 0.03, {0.0, 0.5 * EIGEN_PI, 0.0, 0.0, 0.0, 0.0})};
}

std::vector<Poses> kept_at(double distance, const std::vector<Poses>& motion,
                           const std::shared_ptr<const RobotModel>& model,
                           const CloudSnapshot& cloud) {
  constexpr double kFirstHeight = 1.0, kLargestJump = 0.005;  // [m]
  QueryConfig config;
  config.max_distance = 5.0;
  config.tolerance = 2e-6;
  ProximityQuery query(model, config);
  std::vector<Poses> kept;
  double height = kFirstHeight;
  for (const Poses& X_FL : motion) {
    const double last = height;
    if (!find_height(distance, X_FL, cloud, &query, &height)) break;
    if (!kept.empty() && std::abs(height - last) > kLargestJump) break;
    kept.push_back(X_FL);
    for (Eigen::Isometry3d& X : kept.back()) X.translation().z() += height;
  }
  return kept;
}

}  // namespace ist::benchmark
