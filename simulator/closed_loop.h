#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dodge_controller.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/robot_model.h"
#include "scene.h"
#include "simulation.h"

namespace ist::sim {

/// What the controller follows.
enum class Avoidance {
  kNone,     ///< nothing: it does its task blindly
  kBlend,    ///< `repulsion`
  kNearest,  ///< the nearest pair's `direction`
};

struct ClosedLoopConfig {
  Avoidance avoidance = Avoidance::kBlend;
  bool check_self = false;  ///< look whether links come near one another
  int control_period = 2;   ///< [steps of the simulation] between two answers and commands
  example::DodgeConfig controller;
  IngestConfig ingest;
  QueryConfig query;
  RepulsionConfig repulsion;
  ClosedLoopConfig() {
    ingest.self_filter_padding = 0.03;   // six times the cameras' noise
    repulsion.influence_distance = 0.5;  // `away` is known wherever the controller looks at it
  }
};

/// From the pictures of the simulated cameras to what a controller reads: what the node does.
class Perception {
 public:
  Perception(std::shared_ptr<const RobotModel> model, const ClosedLoopConfig& config,
             std::size_t cameras);

  /// Takes the pictures that have arrived, filtered by the robot's poses at their own stamps.
  void look(Simulation* world);
  /// Answers for the robot as it is now.
  const std::vector<LinkProximity>& answer(const Simulation& world);
  /// The answers as the controller reads them.
  example::Reading reading(const Simulation& world, const example::ControlledArm& arm);

  const std::vector<CloudSnapshot>& snapshots() const { return snapshots_; }  ///< by camera
  bool has_seen() const;  ///< every camera has delivered

 private:
  std::shared_ptr<const RobotModel> model_;
  ClosedLoopConfig config_;
  std::vector<Ingest> ingest_;
  std::vector<CloudSnapshot> snapshots_;
  std::vector<bool> seen_;
  ProximityQuery query_;
  Repulsion repulsion_;
  std::vector<LinkProximity> results_;
  std::vector<Eigen::Isometry3d> X_FL_;
};

/// How a scene went.
struct ClosedLoopResult {
  double smallest_distance = 0.0;  ///< [m] true, of any moved link and obstacle, at any step
  double when = 0.0;               ///< [s]
  std::string link, obstacle;      ///< the two
  int goals = 0;                   ///< reached
  /// [m] of two links that may meet, lower bound, every 20 ms; the controller does not mind it. Inf
  /// unless `check_self` asks for it.
  double smallest_self_distance = std::numeric_limits<double>::infinity();
  /// [rad/s^2] root mean square, over joints and steps, of the acceleration's deviation from its
  /// mean over the 0.1 s about it.
  double acceleration_noise = 0.0;
  double largest_command_step = 0.0;  ///< [rad/s] 99.9th percentile, between two commands
};

/// Runs a scene: simulator -> ingest with self-filter -> query -> repulsion -> controller -> arm.
ClosedLoopResult run_closed_loop(const RobotDescription& robot,
                                 const std::shared_ptr<const RobotModel>& model, const Scene& scene,
                                 std::uint64_t seed, const ClosedLoopConfig& config);

/// Positions of the undisturbed arm, every 10 ms: for make_scene().
std::vector<Eigen::VectorXd> nominal_motion(const RobotDescription& robot, const Scene& scene,
                                            const example::DodgeConfig& config);

}  // namespace ist::sim
