#include "closed_loop.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/cloud/memory_scan.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist::sim {
namespace {

constexpr double kTruthRange = 10.0;  // [m]

/// A reading without obstacles, for an arm that is blind or undisturbed.
example::Reading nothing_near() {
  example::Reading reading;
  reading.is_ok = true;
  reading.speed_scale = 1.0;
  reading.links.resize(1);
  reading.links[0].lower_bound = 1.0;
  reading.links[0].p_LCl.setConstant(std::numeric_limits<double>::quiet_NaN());
  return reading;
}

/// Accumulates the deviation of the accelerations from their moving average over 0.1 s.
double noise(const std::vector<Eigen::VectorXd>& accelerations) {
  constexpr std::size_t kHalf = 50;  // steps
  if (accelerations.size() <= 2 * kHalf) return 0.0;
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(accelerations[0].size());
  for (std::size_t i = 0; i <= 2 * kHalf; ++i) sum += accelerations[i];
  double total = 0.0;
  std::size_t count = 0;
  for (std::size_t i = kHalf; i + kHalf < accelerations.size(); ++i) {
    total += (accelerations[i] - sum / (2 * kHalf + 1)).squaredNorm();
    count += static_cast<std::size_t>(sum.size());
    if (i + kHalf + 1 < accelerations.size()) {
      sum += accelerations[i + kHalf + 1] - accelerations[i - kHalf];
    }
  }
  return std::sqrt(total / static_cast<double>(count));
}

double quantile(std::vector<double> values, double q) {
  if (values.empty()) return 0.0;
  const auto at = static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

std::vector<std::string> link_names(const RobotModel& model) {
  std::vector<std::string> names;
  for (const LinkModel& link : model.links) names.push_back(link.name);
  return names;
}

}  // namespace

Perception::Perception(std::shared_ptr<const RobotModel> model, const ClosedLoopConfig& config,
                       std::size_t cameras)
    : model_(std::move(model)),
      config_(config),
      snapshots_(config.remember ? 2 * cameras : cameras),
      seen_(cameras, false),
      query_(model_, config.query),
      repulsion_(model_),
      speed_scale_(link_names(*model_)) {
  for (std::size_t i = 0; i < cameras; ++i) ingest_.emplace_back(config.ingest);
  for (std::size_t i = 0; config.remember && i < cameras; ++i)
    memories_.emplace_back(config.memory);
}

bool Perception::has_seen() const {
  return std::all_of(seen_.begin(), seen_.end(), [](bool has_image) { return has_image; });
}

void Perception::look(Simulation* world) {
  for (const Picture& picture : world->take_pictures()) {
    const std::vector<Eigen::Isometry3d> X_FL = world->link_poses(picture.stamp);
    const std::vector<PosedSolid> robot =
        posed_solids(*model_, X_FL, std::vector<bool>(X_FL.size(), true));
    const std::size_t c = picture.camera;
    ingest_[c].run(picture.raw(), world->cameras()[c].config().X_FC, robot, picture.stamp,
                   &snapshots_[c]);
    seen_[c] = true;
    if (config_.remember) remember(picture, world->cameras()[c].config().X_FC);
  }
}

void Perception::remember(const Picture& picture, const Eigen::Isometry3d& X_FC) {
  MemoryMap& memory = memories_[picture.camera];
  const RawCloud raw = picture.raw();
  const double range = std::min(config_.ingest.max_range, memory.config().max_range);
  read_memory_scan(raw, snapshots_[picture.camera], X_FC, config_.ingest.min_range, range, &scan_);
  memory.insert(scan_);
  memory.hidden_boxes(&boxes_);
  auto index = std::make_shared<BoxIndex>();
  index->build(boxes_);
  CloudSnapshot& hidden = snapshots_[memories_.size() + picture.camera];
  hidden.boxes = index;
  hidden.stamp = picture.stamp;
}

const std::vector<LinkProximity>& Perception::answer(const Simulation& world) {
  X_FL_ = world.link_poses();
  std::vector<const CloudSnapshot*> clouds;
  for (const CloudSnapshot& snapshot : snapshots_) {
    if (has_seen()) clouds.push_back(&snapshot);
  }
  query_.run(X_FL_, std::vector<bool>(X_FL_.size(), true), clouds, &results_);
  return results_;
}

example::Reading Perception::reading(const Simulation& world, const example::ControlledArm& arm) {
  answer(world);
  example::Reading reading;
  reading.is_ok = has_seen();
  if (!reading.is_ok) return reading;
  std::vector<const CloudSnapshot*> clouds;
  for (const CloudSnapshot& snapshot : snapshots_) {
    clouds.push_back(&snapshot);
    reading.cloud_age = std::max(reading.cloud_age, world.time() - snapshot.stamp);
  }
  scale_inputs_.clear();
  for (const LinkProximity& result : results_) {
    scale_inputs_.push_back({result.state, result.lower_bound});
  }
  const double scale =
      speed_scale_.update(config_.speed_scale, scale_inputs_, world.arm().moved(), 0.0).scale;
  reading.speed_scale = config_.scale_speed ? scale : 1.0;
  for (std::size_t i = 0; i < results_.size(); ++i) {
    example::LinkReading link;
    link.body = *arm.kinematics.find_body(model_->links[i].name);
    link.lower_bound = results_[i].lower_bound;
    link.p_LCl = results_[i].p_LCl;
    if (config_.avoidance == Avoidance::kNearest) link.away = results_[i].direction;
    if (config_.avoidance == Avoidance::kBlend) {
      link.away = repulsion_(i, X_FL_[i], clouds, results_[i], config_.repulsion);
    }
    reading.links.push_back(link);
  }
  return reading;
}

namespace {

/// Keeps the smallest true distance so far, and where it was.
void note_distance(const Simulation& world, const RobotDescription& robot, const Scene& scene,
                   ClosedLoopResult* result) {
  const Simulation::Truth truth = world.nearest(std::min(result->smallest_distance, kTruthRange));
  if (!(truth.distance < result->smallest_distance)) return;
  if (truth.distance <= 0.0 && result->smallest_distance > 0.0) {
    result->speed_at_touch = world.arm().velocities().cwiseAbs().maxCoeff();
  }
  result->smallest_distance = truth.distance;
  result->when = world.time();
  result->link = robot.links[truth.link].name;
  result->obstacle = scene.obstacles[truth.obstacle].name;
}

}  // namespace

ClosedLoopResult run_closed_loop(const RobotDescription& robot,
                                 const std::shared_ptr<const RobotModel>& model, const Scene& scene,
                                 std::uint64_t seed, const ClosedLoopConfig& config) {
  const bool is_blind = config.avoidance == Avoidance::kNone;
  Simulation world(robot, demo_arm(), scene.obstacles,
                   is_blind ? std::vector<DepthCameraConfig>() : scene.cameras, seed);
  world.arm().reset(scene.goals[0]);
  const example::ControlledArm arm(robot, world.arm().config().joints);
  Perception perception(model, config, world.cameras().size());

  ClosedLoopResult result;
  result.smallest_distance = std::numeric_limits<double>::infinity();
  result.task_time = std::numeric_limits<double>::infinity();
  std::vector<Eigen::VectorXd> accelerations;
  std::vector<double> command_steps;
  std::size_t goal = 1 % scene.goals.size();
  Eigen::VectorXd command = Eigen::VectorXd::Zero(scene.goals[0].size());
  for (int step = 0; world.time() < scene.duration ||
                     (result.goals < scene.task && world.time() < scene.patience);
       ++step) {
    if (!is_blind) perception.look(&world);
    if (step % config.control_period == 0) {
      const std::vector<double> q = world.arm().all_positions(world.arm().positions());
      if (has_reached(arm, q, scene.goals[goal], config.controller)) {
        if (++result.goals == scene.task) result.task_time = world.time();
        goal = (goal + 1) % scene.goals.size();
      }
      const example::Reading reading = is_blind ? nothing_near() : perception.reading(world, arm);
      const Eigen::VectorXd next =
          example::dodge(arm, q, scene.goals[goal], reading, config.controller);
      command_steps.push_back((next - command).cwiseAbs().maxCoeff());
      command = next;
    }
    world.step(command);
    accelerations.push_back(world.arm().accelerations());
    note_distance(world, robot, scene, &result);
  }
  result.acceleration_noise = noise(accelerations);
  result.largest_command_step = quantile(command_steps, 0.999);
  return result;
}

std::vector<Eigen::VectorXd> nominal_motion(const RobotDescription& robot, const Scene& scene,
                                            const example::DodgeConfig& config) {
  Arm mover(robot, demo_arm());
  mover.reset(scene.goals[0]);
  const example::ControlledArm arm(robot, mover.config().joints);
  std::vector<Eigen::VectorXd> motion;
  std::size_t goal = 1 % scene.goals.size();
  const auto steps = static_cast<int>(scene.duration / Simulation::kStep);
  Eigen::VectorXd command = Eigen::VectorXd::Zero(scene.goals[0].size());
  for (int step = 0; step < steps; ++step) {
    if (step % 2 == 0) {
      const std::vector<double> q = mover.all_positions(mover.positions());
      if (has_reached(arm, q, scene.goals[goal], config)) goal = (goal + 1) % scene.goals.size();
      command = example::dodge(arm, q, scene.goals[goal], nothing_near(), config);
    }
    if (step % 10 == 0) motion.push_back(mover.positions());
    mover.step(command, Simulation::kStep);
  }
  return motion;
}

}  // namespace ist::sim
