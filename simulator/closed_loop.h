#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dodge_controller.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/control/velocity_filter.h"
#include "ist_proximity/proximity/closing_speed.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/proximity/speed_scale.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/robot_model.h"
#include "scene.h"
#include "simulation.h"

namespace ist::sim {

/// The avoidance signal that the controller follows.
enum class Avoidance {
  kNone,    ///< none: the task is done blindly
  kSlow,    ///< none: the speed scale alone
  kBlend,   ///< `repulsion`
  kFilter,  ///< none: the blind task's velocities pass through a VelocityFilter
};

struct ClosedLoopConfig {
  Avoidance avoidance = Avoidance::kBlend;
  bool scale_speed = true;  ///< the task's speed is multiplied by the speed scale
  int control_period = 2;   ///< [simulation steps] between two queries and commands
  example::DodgeConfig controller;
  IngestConfig ingest;
  QueryConfig query;
  RepulsionConfig repulsion;
  SpeedScaleConfig speed_scale;
  RowConfig rows;                    ///< blind_skin is the self-filter's padding
  double self_stop_distance = 0.01;  ///< [m] of links from each other, with a margin of 0
  /// [rad/s] of the fastest joint. More than 0: within the stop distance the filter is asked for
  /// the way out from what is nearest, in place of the task.
  double leave_speed = 0.0;
  bool remember = false;  ///< what a camera no longer sees stays, as the node's ~memory
  MemoryConfig memory;
  ClosedLoopConfig() {
    speed_scale.free_distance = 0.25;    // as in config/dodge.yaml
    ingest.self_filter_padding = 0.03;   // six times the cameras' noise
    repulsion.influence_distance = 0.5;  // more than any distance the controller reacts to
  }
};

/// Does the node's work: from the images of the simulated cameras to a controller's reading.
class Perception {
 public:
  Perception(std::shared_ptr<const RobotModel> model, const ClosedLoopConfig& config,
             std::size_t cameras);

  /// Takes the images that have arrived, self-filtered by the robot's poses at their own stamps.
  void look(Simulation* world);
  /// Runs the query for the robot's present pose.
  const std::vector<LinkProximity>& answer(const Simulation& world);
  /// The last answers as the controller reads them.
  example::Reading reading(const Simulation& world, const example::ControlledArm& arm);

  /// By camera; with `remember`, what is hidden from each of them follows.
  const std::vector<CloudSnapshot>& snapshots() const { return snapshots_; }
  bool has_seen() const;  ///< every camera has delivered an image

 private:
  std::shared_ptr<const RobotModel> model_;
  ClosedLoopConfig config_;
  std::vector<Ingest> ingest_;
  void remember(const Picture& picture, const Eigen::Isometry3d& X_FC);

  std::vector<CloudSnapshot> snapshots_;
  std::vector<MemoryMap> memories_;  ///< by camera
  MemoryScan scan_;
  VoxelBoxes boxes_;
  std::vector<bool> seen_;
  ProximityQuery query_;
  Repulsion repulsion_;
  SpeedScale speed_scale_;
  std::vector<SpeedScaleInput> scale_inputs_;
  std::vector<LinkProximity> results_;
  std::vector<Eigen::Isometry3d> X_FL_;
};

/// Distances of an arm's links from each other, adjacent ones left out.
class OwnDistances {
 public:
  OwnDistances(const RobotDescription& robot, const std::shared_ptr<const RobotModel>& model,
               const QueryConfig& config);

  /// @param X_FL  by link of the model
  const std::vector<PairProximity>& run(const std::vector<Eigen::Isometry3d>& X_FL);
  const std::vector<LinkPair>& pairs() const { return query_.pairs(); }
  /// [m] The least distance of two links; 0 or less in contact.
  double least(const std::vector<Eigen::Isometry3d>& X_FL);

 private:
  SelfQuery query_;
  std::vector<PairProximity> answers_;
};

/// Passes velocities through a VelocityFilter, its rows those of a Perception, with the speeds of
/// obstacles that the node would tell, and those of links against each other.
class FilteredCommand {
 public:
  FilteredCommand(const RobotDescription& robot, std::shared_ptr<const RobotModel> model,
                  const ArmConfig& arm, const ClosedLoopConfig& config);

  /// @param command  [rad/s] by commanded joint
  /// @returns 0 until every camera has delivered an image
  Eigen::VectorXd run(const Simulation& world, Perception* perception,
                      const Eigen::VectorXd& command);

 private:
  void place_rows(const Simulation& world, Perception* perception, const std::vector<double>& q);
  void hold_others(const std::vector<std::size_t>& commanded);
  bool way_out(std::vector<double>* wanted) const;

  std::shared_ptr<const RobotModel> model_;
  std::shared_ptr<const Kinematics> kinematics_;
  ClosedLoopConfig config_;
  OwnDistances own_;
  ConstraintRowBuilder builder_;
  ConstraintRows rows_;
  VelocityFilter filter_;
  std::vector<ClosingSpeed> speeds_;
};

/// Measurements of one run of a scene.
struct ClosedLoopResult {
  double smallest_distance = 0.0;  ///< [m] true distance of any moved link to any obstacle
  double own_distance = 0.0;       ///< [m] the smallest true one of two links, 20 mm at most
  double when = 0.0;               ///< [s] of the smallest distance
  double last_distance = 0.0;      ///< [m] the same at the end; inf far from all
  std::string link, obstacle;      ///< of the smallest distance
  int goals = 0;                   ///< number of goals reached
  double task_time = 0.0;          ///< [s] when the task was done; inf: it was not
  /// [rad/s] of the fastest joint at the first touch; 0 without any.
  double speed_at_touch = 0.0;
  /// [m/s] at which the arm, by its own motion alone, came nearer to what it touched: the most of
  /// all touches, of obstacles and of links; 0 or less where nothing was driven into.
  double driven_at_touch = 0.0;
};

/// Runs a scene: simulator -> ingest with self-filter -> query -> repulsion -> controller -> arm.
ClosedLoopResult run_closed_loop(const RobotDescription& robot,
                                 const std::shared_ptr<const RobotModel>& model, const Scene& scene,
                                 std::uint64_t seed, const ClosedLoopConfig& config);

/// Positions of the undisturbed arm every 10 ms, as make_scene() needs them.
std::vector<Eigen::VectorXd> nominal_motion(const RobotDescription& robot, const Scene& scene,
                                            const example::DodgeConfig& config);

}  // namespace ist::sim
