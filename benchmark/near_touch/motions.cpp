#include "near_touch/motions.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

#include "hard_cases/demo_motion.h"
#include "internal/geometry/mesh_io.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/npy.h"
#include "support/truth.h"

namespace ist::benchmark {
namespace {

constexpr std::size_t kPosesPerPart = 6, kStepsPerPose = 10;
constexpr std::size_t kStride = 167;  // recorded poses, or hundredths of a second, between parts

RobotDescription panda(const std::filesystem::path& data, bool visual) {
  RobotDescription robot;
  robot.name = "panda";
  for (std::size_t i = 1; i < test::kPandaLinks; ++i) {  // link 0 stands still
    const std::string name = test::panda_mesh(i);
    const auto meshes = data / "robots/franka_description/meshes";
    const auto hull = meshes / "collision" / (name + ".stl");  // the fingers have none
    const auto file =
        visual || !std::filesystem::exists(hull) ? meshes / "visual" / (name + ".dae") : hull;
    LinkDescription link;
    link.name = name + std::to_string(i);
    link.geometry = {
        GeometryElement{load_mesh(file.string()), Eigen::Isometry3d::Identity(), file.string()}};
    robot.links.push_back(std::move(link));
  }
  return robot;
}

// The recorded poses of the links that move.
std::vector<Poses> recorded(const std::filesystem::path& data) {
  const test::Npy array = test::read_npy((data / "poses/traj.npy").string());
  std::vector<Poses> motion(array.shape.at(0));
  for (std::size_t k = 0; k < motion.size(); ++k) {
    for (std::size_t link = 1; link < test::kPandaLinks; ++link) {
      Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
      for (int i = 0; i < 12; ++i) {
        X.matrix()(i / 4, i % 4) =
            array.values.at((k * test::kPandaLinks + link) * 12 + static_cast<std::size_t>(i));
      }
      motion[k].push_back(X);
    }
  }
  return motion;
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

std::vector<MovingRobot> pandas(const std::filesystem::path& data) {
  const auto motion = std::make_shared<const std::vector<Poses>>(recorded(data));
  const auto part = [motion](std::size_t number) {
    const std::size_t first = number * kStride % (motion->size() - kPosesPerPart);
    const auto begin = motion->begin() + static_cast<std::ptrdiff_t>(first);
    return interpolated({begin, begin + kPosesPerPart}, kStepsPerPose);
  };
  return {{"Panda, visual meshes", panda(data, true), part},
          {"Panda, collision meshes", panda(data, false), part}};
}

MovingRobot demo_arm() {
  const auto arm = std::make_shared<const DemoMotion>();
  RobotDescription robot;
  robot.name = arm->robot().name;
  std::vector<std::size_t> moving;
  for (std::size_t i = 0; i < arm->robot().links.size(); ++i) {
    const LinkDescription& link = arm->robot().links[i];
    if (link.name == "base_link" || link.name == "stand_link") continue;
    moving.push_back(i);
    robot.links.push_back(link);
  }
  const auto part = [arm, moving](std::size_t number) {
    constexpr double kSwing = 0.5;  // [rad]
    std::vector<Poses> poses;
    for (std::size_t k = 0; k + kStepsPerPose < kPosesPerPart * kStepsPerPose; ++k) {
      const double t =
          0.01 * static_cast<double>(number * kStride) + 0.001 * static_cast<double>(k);
      const auto swing = [t](double phase) { return kSwing * std::sin(1.5 * t + phase); };
      const Poses all = arm->poses({swing(0.0), 0.9 + swing(1.0), 0.9 + swing(2.0), swing(3.0),
                                    0.8 + swing(4.0), swing(5.0)});
      poses.emplace_back();
      for (const std::size_t i : moving) poses.back().push_back(all[i]);
    }
    return poses;
  };
  return {"demo arm", robot, part};
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
