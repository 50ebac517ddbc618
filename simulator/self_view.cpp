#include "self_view.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/cloud/point_bvh.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "scene.h"
#include "touch_view.h"

namespace ist::sim {
namespace {

constexpr double kNear = 0.05;  // [m]
constexpr double kBallRadius = 0.05;
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

// Each joint follows a sum of two sines of incommensurable frequencies.
const double kMean[] = {0.0, 0.35, 1.1, 0.0, 0.1, 0.0};
const double kAmplitude[2][6] = {{0.6, 0.25, 0.3, 0.7, 0.4, 0.9}, {0.2, 0.15, 0.2, 0.3, 0.3, 0.4}};
const double kRate[2][6] = {{0.83, 0.71, 0.97, 0.61, 1.13, 0.53}, {1.9, 1.7, 1.6, 1.3, 2.1, 1.1}};

struct Trial {
  Ingest ingest;
  ProximityQuery query;
  CloudSnapshot cloud;
  SelfViewResult result;
  std::vector<LinkProximity> answers;

  Trial(const std::shared_ptr<const RobotModel>& model, const IngestConfig& config)
      : ingest(config), query(model, {}) {
    cloud.stamp = kNan;
    result.padding = config.self_filter_padding;
    result.smallest_distance = std::numeric_limits<double>::infinity();
  }
};

double smallest(const std::vector<LinkProximity>& answers) {
  double distance = std::numeric_limits<double>::infinity();
  for (const LinkProximity& link : answers) {
    if (link.state != LinkState::kUnknown) distance = std::min(distance, link.distance);
  }
  return distance;
}

// Points off the ball are the robot's own, because nothing else is there.
std::uint64_t count_phantoms(const PointIndex& index, const Obstacle* ball, double stamp,
                             double noise) {
  std::uint64_t count = 0;
  const PointBvh& bvh = index.bvh();
  PointTile scratch;
  for (std::size_t i = 0; i < bvh.tile_count(); ++i) {
    const PointTile& tile = bvh.tile(i, &scratch);
    for (int k = 0; k < tile.count; ++k) {
      const Eigen::Vector3d p = index.X_FO() * tile.point(k);
      const bool is_ball = ball != nullptr &&
                           (p - ball->pose(stamp).translation()).norm() < kBallRadius + 6.0 * noise;
      count += is_ball ? 0 : 1;
    }
  }
  return count;
}

// Makes a ball beside the forearm's tube as seen from the camera, so that the gap is in view.
// p_FC is the camera's position; the ball keeps `distance` [m] from the tube.
Obstacle ball_at_forearm(const RobotDescription& robot, const Eigen::Vector3d& p_FC,
                         double distance) {
  const Arm arm(robot, demo_arm());
  const auto is_forearm = [](const LinkDescription& l) { return l.name == "forearm_link"; };
  const auto forearm = static_cast<std::size_t>(
      std::find_if(robot.links.begin(), robot.links.end(), is_forearm) - robot.links.begin());
  const double beside = 0.026 + distance + kBallRadius;
  Obstacle ball;
  ball.name = "ball";
  ball.shape = Sphere{kBallRadius};
  ball.path = [arm, forearm, beside, p_FC](double t) -> Eigen::Vector3d {
    const Eigen::Isometry3d X_FL = arm.link_poses(self_view_positions(t))[forearm];
    const Eigen::Vector3d p = X_FL * Eigen::Vector3d(0.0, 0.0, 0.170);
    const Eigen::Vector3d side = X_FL.linear().col(2).cross(p - p_FC).normalized();
    return p + beside * (side.z() < 0.0 ? -side : side);
  };
  return ball;
}

}  // namespace

Eigen::VectorXd self_view_positions(double t) {
  Eigen::VectorXd q(6);
  for (int j = 0; j < 6; ++j) {
    q[j] = kMean[j];
    for (int k = 0; k < 2; ++k) q[j] += kAmplitude[k][j] * std::sin(kRate[k][j] * t);
  }
  return q;
}

std::vector<SelfViewResult> run_self_view(const RobotDescription& robot,
                                          const std::shared_ptr<const RobotModel>& model,
                                          const SelfViewConfig& config) {
  DepthCameraConfig camera = demo_cameras()[0];
  camera.noise = config.noise;
  camera.flying_pixels = config.flying_pixels;
  camera.latency = config.latency;
  camera.period = config.camera_period;
  camera.width *= config.resolution;
  camera.height *= config.resolution;
  camera.focal_length *= config.resolution;
  const Eigen::Isometry3d X_FS =
      with_error(camera.X_FC, config.position_error, config.angle_error, config.seed);

  std::vector<Obstacle> obstacles;
  if (config.ball_distance > 0.0) {
    obstacles.push_back(ball_at_forearm(robot, camera.X_FC.translation(), config.ball_distance));
  }
  const Obstacle* ball = obstacles.empty() ? nullptr : obstacles.data();

  Simulation world(robot, demo_arm(), obstacles, {camera}, config.seed);
  world.arm().reset(self_view_positions(0.0));
  std::vector<Trial> trials;
  for (const double padding : config.paddings) {
    IngestConfig ingest;
    ingest.self_filter_padding = padding;
    ingest.self_filter_mode = config.mode;
    ingest.view = config.view;
    trials.emplace_back(model, ingest);
  }
  const std::vector<bool> known(robot.links.size(), true);
  const auto steps = static_cast<int>(config.duration / Simulation::kStep);
  for (int step = 0; step < steps; ++step) {
    const double t = world.time();
    world.step((self_view_positions(t + Simulation::kStep) - world.arm().positions()) /
               Simulation::kStep);
    for (const Picture& picture : world.take_pictures()) {
      const std::vector<PosedSolid> posed =
          posed_solids(*model, world.link_poses(picture.stamp), known);
      for (Trial& trial : trials) {
        trial.ingest.run(picture.raw(), X_FS, posed, picture.stamp, &trial.cloud);
        trial.result.pictures += 1;
        trial.result.on_robot += trial.cloud.counts.on_robot;
        trial.result.phantoms +=
            count_phantoms(trial.cloud.index, ball, picture.stamp, config.noise);
      }
    }
    if (step % config.query_period != 0 || std::isnan(trials[0].cloud.stamp)) continue;
    const bool is_near = ball != nullptr && world.nearest(kNear).distance < kNear;
    const double then = is_near ? world.nearest_then(1.0, trials[0].cloud.stamp).distance : kNan;
    const std::vector<Eigen::Isometry3d> X_FL = world.link_poses();
    for (Trial& trial : trials) {
      trial.query.run(X_FL, known, {&trial.cloud}, &trial.answers);
      SelfViewResult& result = trial.result;
      const double distance = smallest(trial.answers);
      result.answers += 1;
      result.contacts += distance < 0.0 ? 1 : 0;
      result.smallest_distance = std::min(result.smallest_distance, distance);
      if (!is_near) continue;
      result.near += 1;
      result.largest_excess = std::max(result.largest_excess, distance - then);
    }
  }
  std::vector<SelfViewResult> results;
  results.reserve(trials.size());
  for (const Trial& trial : trials) results.push_back(trial.result);
  return results;
}

}  // namespace ist::sim
