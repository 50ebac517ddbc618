#pragma once

#include <ist_proximity/JointRepulsion.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/time.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "internal/proximity/carried_worlds.h"
#include "internal/repulsion/coherent_queries.h"
#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/proximity/closing_speed.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/repulsion/repulsion.h"
#include "ros/cycle/add_on_cycle.h"
#include "ros/cycle/cloud_selection.h"
#include "ros/cycle/late_frames.h"
#include "ros/cycle/late_joints.h"
#include "ros/cycle/robot_future.h"
#include "ros/cycle/scene_warm_up.h"
#include "ros/cycle/world_answers.h"
#include "ros/input/source.h"
#include "ros/model/model_state.h"
#include "ros/output/joint_repulsion.h"
#include "ros/output/markers.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/pose_source.h"
#include "ros/status/cycle_report.h"
#include "ros/status/status.h"

namespace ist {

/// The shares of a cycle's deadline at which distances and repulsion have to be there.
constexpr double kQueryShare = 0.7, kRepulsionShare = 0.9;

/// Turns link poses and clouds into one ProximityArray per cycle, for one robot model. It uses the
/// newest data and never waits. One thread.
class ProximityCycle {
 public:
  /// @param model  with a robot, of which links may be pending
  /// @param poses  of model->robot->links; null where the kinematics that it needs is faulty
  /// @param add_ons  their parts in the cycle, see make_cycles()
  ProximityCycle(std::shared_ptr<const ModelState> model, const ServerConfig& config,
                 std::unique_ptr<PoseSource> poses, CloudSelection::Reader reader,
                 std::vector<std::unique_ptr<AddOnCycle>> add_ons = {});

  /// @param now      the ROS clock's time
  /// @param message  overwritten; its memory is kept, so that a message that was used by a cycle
  ///                 before costs no allocation
  /// @param config   query.deadline is in seconds here, from known poses on: distances take
  ///                 kQueryShare of it at most, repulsion ends at kRepulsionShare, and contact
  ///                 volumes at the deadline. Repulsion that is late is held (see
  ///                 RepulsionFilter), volumes that are late are NaN, and the status says so
  /// @param transform_problem  what tf's listener has to say; empty: nothing
  void run(const ros::Time& now, const CloudSources& sources, const LiveConfig& config,
           const std::string& transform_problem, ist_proximity::ProximityArray* message);

  /// Writes what the last run() found: sources, poses, status and deadline; the times are added.
  /// @param message  of that run()
  void report(const ist_proximity::ProximityArray& message, CycleReport* report) const;

  /// Forgets the last cycles after a jump of the clock: no speed is computed across it, and the
  /// repulsion's filter and the stamps start again.
  void forget();

  /// Takes finer packings of the same robot. Nothing that is known is lost: filters, speeds and
  /// the query's bounds go on.
  /// @param model  see is_refinement()
  void refine(const std::shared_ptr<const ModelState>& model);

  /// Takes how far loading is, and what is said of the model, where the robot stays the same.
  void set_problem(const ModelState& model);

  /// Makes the next answer's stamp not go back before this one, which another cycle gave.
  void continue_from(const ros::Time& stamp) { poses_.stamp = stamp; }

  /// Sets whether the threads of sources make the first answers with their new clouds. The first
  /// call that says so allocates the memory of a query.
  /// @param warm_up  outlives this; that of no other cycle. Null: they are not
  void set_warm_up(SceneWarmUp* warm_up);

  /// The clouds of the last run(); valid until the next one.
  SnapshotSpan clouds() const { return selection_.clouds(); }
  /// Whether known worlds were among the obstacles of the last run().
  bool has_worlds() const { return worlds_.any(); }
  /// The known worlds of the last run(), likewise, and what they are measured with.
  Span<const PosedWorld* const> worlds() const { return selection_.worlds(); }
  const WorldAnswers& world_answers() const { return worlds_; }
  /// [m] How far obstacles within a sphere may have come since their frames' poses of the last
  /// run().
  double late_obstacles(const Eigen::Vector3d& center_F, double radius) const {
    return std::max(late_worlds_.within(center_F, radius), late_maps_.within(center_F, radius));
  }
  /// By link of the robot: whether the last run() could measure it if it had a pose.
  const std::vector<bool>& measurable() const { return measurable_; }

  /// By monitored link: what it would reach until it stands, if all joints moved as fast as the
  /// URDF allows. Empty where ~joint_deceleration is not stated.
  Span<const StoppingReach> full_speed_reach() const { return future_.at_full_speed(); }

  /// The scene that is drawn beside the message of the last run(), in the fixed frame. The box
  /// encloses the inner spheres of all links whose pose was known; each sphere is looked at, which
  /// is for pictures and not for every cycle.
  MarkerScene marker_scene() const;

  /// Gives the repulsion of the last run() as joint efforts.
  /// @param self_problem  with ~self_collision/in_minimum: why `self` cannot be used; else empty
  /// @param self          the newest ~self_proximity, whose repulsion is added with
  ///                      ~self_collision/in_minimum; may be null
  /// @param message       has the stamp and the status of the message of that run()
  void fill_joint_repulsion(const std::string& self_problem,
                            const ist_proximity::ProximityArray* self,
                            ist_proximity::JointRepulsion* message);

 private:
  void note_usage(const LiveConfig& config);
  void look_up_poses(const ros::Time& now);
  void describe_pose_problems(const std::string& transform_problem);
  void take_warm_queries();
  void note_asked(const LiveConfig& config);
  void run_query(const LiveConfig& config, TimePoint begin);
  void note_late_frames();
  void place_carried_objects();
  void run_add_ons(const LiveConfig& config);
  void find_urgent_links();
  void compute_pushes(const LiveConfig& config, TimePoint end);
  Wrench penetration(std::size_t link, const LiveConfig& config, TimePoint end);
  void add_self_repulsion(const ist_proximity::ProximityArray* self);
  void fill_links(ist_proximity::ProximityArray* message);

  const std::shared_ptr<const ModelState> model_;
  std::shared_ptr<const RobotModel> packed_;  ///< the same robot with the newest packings
  const RobotModel& robot_;
  const std::vector<LinkBox> boxes_;  ///< by link
  std::string fixed_frame_;
  std::unique_ptr<PoseSource> pose_source_;
  const double pose_timeout_;  ///< [s]
  const bool self_counts_;     ///< ~self_collision/in_minimum
  RobotFuture future_;
  CloudSelection selection_;
  WorldAnswers worlds_;
  CarriedWorlds carried_;
  std::unique_ptr<CoherentQueries> queries_;
  SceneWarmUp* warm_up_ = nullptr;    ///< null: no other thread helps
  bool has_spare_ = false;            ///< whether there are spare queries
  std::uint64_t last_obstacles_ = 0;  ///< key of the clouds of the last cycle
  std::uint64_t partial_ = 0;         ///< counts answers of objects that were not all measured
  AskedScene asked_;
  const std::vector<std::unique_ptr<AddOnCycle>> add_ons_;
  std::vector<RepulsionFilter> filters_;  ///< by link of the robot
  std::vector<ClosingSpeed> speeds_;      ///< by link of the robot
  JointRepulsion joint_repulsion_;

  std::vector<bool> wanted_;  ///< by link of the robot: see wanted_links()

  // Valid for one cycle.
  ros::Time now_;
  double deadline_ = 0.0;  ///< [s] 0: none
  Status status_{0, ""};
  std::vector<bool> measurable_, known_;  ///< by link of the robot
  StampedLinkPoses poses_;
  LateJoints late_joints_;
  LateFrames late_worlds_, late_maps_;
  StatusInput status_input_;
  Findings model_findings_, findings_;        ///< the former for all cycles
  std::vector<LinkProximity> results_;        ///< by link of the robot: clouds and worlds
  std::vector<LinkProximity> cloud_results_;  ///< the same of clouds alone
  std::vector<RepulsiveWrench> pushes_;       ///< by link of the robot, filtered
  std::vector<RepulsiveWrench> all_pushes_;   ///< the same, with those of link against link
  std::vector<Wrench> wrenches_;              ///< by link of the robot
  std::vector<std::size_t> urgent_;           ///< monitored links, the least lower bound first
};

}  // namespace ist
