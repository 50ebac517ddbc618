#include "closed_loop.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "internal/cloud/memory_scan.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist::sim {
namespace {

constexpr double kTruthRange = 10.0;  // [m]
constexpr double kOwnRange = 0.02;    // [m] in which links are measured from each other
constexpr double kReach = 1.0;        // [m] more than any link's distance from a joint's axis
constexpr double kCanLeave = 0.1;  // of a link's motion, what at least leads away from an obstacle
constexpr double kTouchRange = 0.001;  // [m] in which touches are looked for after the first one

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
    if (config_.avoidance == Avoidance::kBlend) {
      link.away = repulsion_(i, X_FL_[i], clouds, results_[i], config_.repulsion);
    }
    reading.links.push_back(link);
  }
  return reading;
}

OwnDistances::OwnDistances(const RobotDescription& robot,
                           const std::shared_ptr<const RobotModel>& model,
                           const QueryConfig& config)
    : query_(model,
             self_collision_pairs(*model, Kinematics(robot),
                                  std::vector<bool>(model->links.size(), true), {}),
             config) {}

const std::vector<PairProximity>& OwnDistances::run(const std::vector<Eigen::Isometry3d>& X_FL) {
  query_.run(X_FL, std::vector<bool>(X_FL.size(), true), &answers_);
  return answers_;
}

double OwnDistances::least(const std::vector<Eigen::Isometry3d>& X_FL) {
  double least = std::numeric_limits<double>::infinity();
  for (const PairProximity& pair : run(X_FL)) least = std::min(least, pair.distance);
  return least;
}

FilteredCommand::FilteredCommand(const RobotDescription& robot,
                                 std::shared_ptr<const RobotModel> model, const ArmConfig& arm,
                                 const ClosedLoopConfig& config)
    : model_(std::move(model)),
      kinematics_(std::make_shared<const Kinematics>(robot)),
      config_(config),
      own_(robot, model_, config.query),
      builder_(*model_, kinematics_, own_.pairs()),
      filter_(joint_limits(*kinematics_, arm.max_velocity)),
      speeds_(model_->links.size()) {
  config_.rows.blind_skin = config.ingest.self_filter_padding;
}

void FilteredCommand::place_rows(const Simulation& world, Perception* perception,
                                 const std::vector<double>& q) {
  const std::vector<LinkProximity>& answers = perception->answer(world);
  const std::vector<Eigen::Isometry3d> X_FL = world.link_poses();
  std::vector<double> obstacle_speeds(answers.size());
  for (std::size_t i = 0; i < answers.size(); ++i) {
    const int source = answers[i].source;
    const double stamp =
        source < 0 ? 0.0 : perception->snapshots()[static_cast<std::size_t>(source)].stamp;
    const auto generation = static_cast<std::uint64_t>(std::llround(stamp / Simulation::kStep));
    const ClosingRates rates =
        speeds_[i].update(world.time(), answers[i], X_FL[i], {source, generation, stamp});
    obstacle_speeds[i] = std::max(0.0, rates.obstacles);  // of NaN: 0
  }
  RowConfig config = config_.rows;
  for (const CloudSnapshot& cloud : perception->snapshots()) {
    config.age = std::max(config.age, world.time() - cloud.stamp);
  }
  JointPoses joint_poses;
  BodyPoses bodies;
  kinematics_->place_joints(q, &joint_poses);
  kinematics_->place_bodies(joint_poses, Eigen::Isometry3d::Identity(), &bodies);
  builder_.begin(bodies, config);
  builder_.add_links(answers, obstacle_speeds);
  config.margin = config.blind_skin = 0.0;
  config.stop_distance = config_.self_stop_distance;
  builder_.set_config(config);
  builder_.add_pairs(own_.run(X_FL));
  rows_ = builder_.rows();
}

// Joints that are not commanded stand.
void FilteredCommand::hold_others(const std::vector<std::size_t>& commanded) {
  const std::vector<std::size_t>& columns = builder_.joints();
  for (std::size_t c = 0; c < columns.size(); ++c) {
    if (std::find(commanded.begin(), commanded.end(), columns[c]) != commanded.end()) continue;
    rows_.G.col(static_cast<Eigen::Index>(c)).setZero();
    rows_.sweep.col(static_cast<Eigen::Index>(c)).setZero();
  }
}

// The gradient of the smallest distance from an obstacle that joints can change: a link that turns
// about its own axis has none but noise. False beyond the stop distance.
bool FilteredCommand::way_out(std::vector<double>* wanted) const {
  double least = config_.rows.stop_distance + config_.rows.blind_skin, fastest = 0.0;
  Eigen::VectorXd away;
  for (std::size_t i = 0; i < rows_.count; ++i) {
    if (rows_.origins[i].is_pair || !(rows_.origins[i].bound < least)) continue;
    const auto row = static_cast<Eigen::Index>(i);
    if (!(rows_.G.row(row).norm() > kCanLeave * rows_.sweep.row(row).norm())) continue;
    least = rows_.origins[i].bound;
    away = -rows_.G.row(row).transpose();
    fastest = away.cwiseAbs().maxCoeff();
  }
  if (!(fastest > 0.0)) return false;
  Eigen::Map<Eigen::VectorXd>(wanted->data(), away.size()) = config_.leave_speed / fastest * away;
  return true;
}

Eigen::VectorXd FilteredCommand::run(const Simulation& world, Perception* perception,
                                     const Eigen::VectorXd& command) {
  Eigen::VectorXd given = Eigen::VectorXd::Zero(command.size());
  if (!perception->has_seen()) return given;
  const std::vector<double> all = world.arm().all_positions(world.arm().positions());
  const std::vector<std::size_t>& columns = builder_.joints();
  const std::vector<std::size_t>& commanded = world.arm().joints();
  place_rows(world, perception, all);
  hold_others(commanded);
  std::vector<double> wanted(columns.size(), 0.0), q;
  const bool leaves = config_.leave_speed > 0.0 && way_out(&wanted);
  for (std::size_t c = 0; c < columns.size(); ++c) {
    q.push_back(all[columns[c]]);
    const auto at = std::find(commanded.begin(), commanded.end(), columns[c]);
    if (at != commanded.end() && !leaves) wanted[c] = command[at - commanded.begin()];
  }
  const FilterAnswer& answer = filter_.run(wanted, q, rows_);
  for (std::size_t j = 0; j < commanded.size(); ++j) {
    const auto at = std::find(columns.begin(), columns.end(), commanded[j]);
    given[static_cast<Eigen::Index>(j)] =
        answer.velocity[static_cast<std::size_t>(at - columns.begin())];
  }
  return given;
}

namespace {

/// [m/s] How fast the arm came nearer in the last step, while obstacles stood.
double driven_speed(const Simulation& world, const Eigen::VectorXd& q_before) {
  Simulation before = world;
  before.arm().reset(q_before);
  const double then = world.time() - Simulation::kStep;
  return (before.nearest_then(kTruthRange, then).distance -
          world.nearest_then(kTruthRange, then).distance) /
         Simulation::kStep;
}

/// Keeps the smallest true distances of a run, where they were, and how touches came about.
class Truth {
 public:
  Truth(const RobotDescription& robot, const std::shared_ptr<const RobotModel>& model,
        const Scene& scene)
      : robot_(robot), scene_(scene), own_(robot, model, exact()) {
    result.smallest_distance = result.own_distance = std::numeric_limits<double>::infinity();
    result.task_time = std::numeric_limits<double>::infinity();
  }

  /// @param q_before  [rad] by commanded joint, before the last step
  void note(const Simulation& world, const Eigen::VectorXd& q_before) {
    note_obstacles(world, q_before);
    left_ -= kReach * (world.arm().positions() - q_before).lpNorm<1>();
    if (left_ <= 0.0) note_own(world);
  }

  ClosedLoopResult result;

 private:
  // Cylinders that are close to each other take long at tolerance 0.
  static QueryConfig exact() {
    QueryConfig config;
    config.tolerance = 1e-7;  // [m] over a step, 0.1 mm/s
    config.max_distance = kOwnRange;
    return config;
  }

  void note_own(const Simulation& world) {
    const double own = std::min(own_.least(world.link_poses()), kOwnRange);
    if (own <= 0.0 && last_own_ > 0.0) touch((last_own_ - own) / (world.time() - own_time_));
    last_own_ = own;
    own_time_ = world.time();
    left_ = own > 0.0 ? own : kOwnRange;
    result.own_distance = std::min(result.own_distance, own);
  }

  void touch(double speed) {
    result.driven_at_touch = has_touched_ ? std::max(result.driven_at_touch, speed) : speed;
    has_touched_ = true;
  }

  void note_obstacles(const Simulation& world, const Eigen::VectorXd& q_before) {
    const double limit = std::clamp(result.smallest_distance, kTouchRange, kTruthRange);
    const Simulation::Truth truth = world.nearest(limit);
    const bool touches = truth.distance <= 0.0;
    if (touches && !has_contact_) {
      if (!has_touched_) result.speed_at_touch = world.arm().velocities().cwiseAbs().maxCoeff();
      touch(driven_speed(world, q_before));
    }
    has_contact_ = touches;
    if (!(truth.distance < result.smallest_distance)) return;
    result.smallest_distance = truth.distance;
    result.when = world.time();
    result.link = robot_.links[truth.link].name;
    result.obstacle = scene_.obstacles[truth.obstacle].name;
  }

  const RobotDescription& robot_;
  const Scene& scene_;
  OwnDistances own_;
  double last_own_ = kOwnRange, own_time_ = 0.0;  // [m], and when that was measured [s]
  double left_ = 0.0;  // [m] that links may move until they can touch, or have parted
  bool has_contact_ = false, has_touched_ = false;
};

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

  Truth truth(robot, model, scene);
  ClosedLoopResult& result = truth.result;
  FilteredCommand filter(robot, model, world.arm().config(), config);
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
      const bool is_filtered = config.avoidance == Avoidance::kFilter;
      const example::Reading reading =
          is_blind || is_filtered ? nothing_near() : perception.reading(world, arm);
      command = example::dodge(arm, q, scene.goals[goal], reading, config.controller);
      if (is_filtered) command = filter.run(world, &perception, command);
    }
    const Eigen::VectorXd q_before = world.arm().positions();
    world.step(command);
    truth.note(world, q_before);
  }
  result.last_distance = world.nearest(kTruthRange).distance;
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
