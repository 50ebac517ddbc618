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
constexpr std::size_t kPartsOfScene = 20;
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

// The demo arm without the links that stand still.
// @param swing   [rad] amplitude of the joints
// @param middle  [rad] about which they swing, by joint
MovingRobot demo_arm(const std::string& name, const std::shared_ptr<const DemoMotion>& arm,
                     double swing, const std::vector<double>& middle) {
  RobotDescription robot;
  robot.name = arm->robot().name;
  std::vector<std::size_t> moving;
  for (std::size_t i = 0; i < arm->robot().links.size(); ++i) {
    const LinkDescription& link = arm->robot().links[i];
    if (link.name == "base_link" || link.name == "stand_link") continue;
    moving.push_back(i);
    robot.links.push_back(link);
  }
  const auto part = [=](std::size_t number) {
    constexpr double kRate = 1.5;  // [rad/s]
    std::vector<Poses> poses;
    for (std::size_t k = 0; k < (kPosesPerPart - 1) * kStepsPerPose; ++k) {
      const double t =
          0.01 * static_cast<double>(number * kStride) + 0.001 * static_cast<double>(k);
      std::vector<double> q = middle;
      for (std::size_t j = 0; j < q.size(); ++j) {
        q[j] += swing * std::sin(kRate * t + static_cast<double>(j));
      }
      const Poses all = arm->poses(q);
      poses.emplace_back();
      for (const std::size_t i : moving) poses.back().push_back(all[i]);
    }
    return poses;
  };
  return {name, robot, part};
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

std::vector<MovingRobot> demo_arms() {
  const auto arm = std::make_shared<const DemoMotion>();
  return {demo_arm("demo arm", arm, 0.5, {0.0, 0.9, 0.9, 0.0, 0.8, 0.0}),
          demo_arm("demo arm, level", arm, 0.03, {0.0, 0.5 * EIGEN_PI, 0.0, 0.0, 0.0, 0.0})};
}

std::vector<HardScene> recorded_scenes(const std::filesystem::path& data,
                                       const std::string& cache_directory) {
  const MovingRobot robot = pandas(data).front();
  // Parts of the motion, one after the other; the first query of each is as good as cold.
  const auto motion = std::make_shared<std::vector<Poses>>();
  for (std::size_t part = 0; part < kPartsOfScene; ++part) {
    for (const Poses& X_FL : robot.part(part)) motion->push_back(X_FL);
  }
  std::vector<HardScene> scenes;
  for (const Scene& recorded : kinect_data(data, cache_directory).scenes) {
    HardScene scene;
    scene.name = "Kinect frame " + recorded.name;
    scene.link = robot.name;
    scene.robot = robot.robot;
    scene.is_recorded = true;
    scene.image = [frame = recorded.frame](std::size_t /*points*/, double /*noise*/,
                                           std::mt19937_64* rng) {
      return next_image(frame, kKinectNoise, rng);
    };
    scene.poses = [motion](double time) {
      return (*motion)[static_cast<std::size_t>(std::lround(1e3 * time)) % motion->size()];
    };
    scenes.push_back(std::move(scene));
  }
  return scenes;
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
