#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// A straight motion in joint space at constant speeds.
struct JointMotion {
  /// [rad, m] positions at the start, by joint of the kinematics. NaN in both `from` and `to`: the
  /// joint stands still, or follows the one that it mimics.
  std::vector<double> from;
  std::vector<double> to;  ///< [rad, m] positions at the end, likewise
  double duration = 1.0;   ///< [s] > 0
};

/// When a link first touches an obstacle.
struct ImpactTime {
  /// [s] from the start of the motion, never later than the first contact; 0 in contact, +inf
  /// without contact, NaN when not known.
  double time = std::numeric_limits<double>::quiet_NaN();
  /// False: the search stopped after many steps; the contact, if any, may be much later.
  bool converged = true;
  int steps = 0;  ///< distance queries
};

/// Conservative time of impact of a robot's links along a joint motion, with obstacles that stand
/// or that the robot carries.
///
/// Conservative advancement (Mirtich 1996): a link whose distance is proven to be d or more cannot
/// touch anything before one of its points is d from where it was. Each step bounds that by the
/// distances of its bounding sphere from the axes of all joints that move it. Distances are lower
/// bounds of ProximityQuery, margin included, so no contact comes before the time that is returned.
/// The search ends where the bound is below 1 um: along glancing motions that may be long before a
/// contact, or without one. One object per thread.
class TimeOfImpact {
 public:
  /// @param config  max_distance and margin are read: the time is that of a distance of `margin`
  TimeOfImpact(std::shared_ptr<const RobotModel> model,
               std::shared_ptr<const Kinematics> kinematics, const QueryConfig& config);
  ~TimeOfImpact();
  TimeOfImpact(TimeOfImpact&&) noexcept;
  TimeOfImpact& operator=(TimeOfImpact&&) noexcept;

  /// @param motion   sizes as the kinematics' joints
  /// @param still    poses of joints that the motion does not move; planar and floating ones too
  /// @param X_FR     root link -> fixed frame
  /// @param wanted   by link of the model: false skips the link, and its time is NaN
  /// @param clouds   as for ProximityQuery::run; none makes every link unknown
  /// @param results  by link of the model, overwritten; every time is NaN where the sizes of the
  ///                 other arguments differ, the duration is not finite and more than 0, or a joint
  ///                 has one position or one above 1e9
  void run(const JointMotion& motion, const JointPoses& still, const Eigen::Isometry3d& X_FR,
           const std::vector<bool>& wanted, SnapshotSpan clouds, std::vector<ImpactTime>* results);

  /// The same beside known worlds: the first contact with a cloud or an object counts. Objects in
  /// the frame of a body of the kinematics, which has its name, move with it where joints move the
  /// body; all others stand where they are. Needs set_surfaces().
  /// @param clouds  where there are none, the worlds alone decide
  /// @param worlds  as for WorldQuery::run. Where there are some and surfaces are not set, every
  ///                time is NaN
  void run(const JointMotion& motion, const JointPoses& still, const Eigen::Isometry3d& X_FR,
           const std::vector<bool>& wanted, SnapshotSpan clouds,
           Span<const PosedWorld* const> worlds, std::vector<ImpactTime>* results);

  /// The clearance along a trajectory: the first contact of each link, and a bound of its distance
  /// on the way. Between two distances that are measured, a link moves by no more than the first
  /// one allows; a quarter of it where it is far from everything.
  /// @param pieces  of straight_pieces(); mimic joints of which every position is NaN follow
  /// @param from    [s] of the trajectory: what comes before is over
  /// @param obstacle_speed  [m/s] >= 0: points and objects may come nearer by so much since `from`
  /// @param obstacle_age    [s] >= 0: and have for so long before it
  /// @param results  by link of the model, overwritten; NaN as above, and where times do not rise
  /// or
  ///                 numbers are not finite, or above 1e9
  void run(const StraightPieces& pieces, double from, const JointPoses& still,
           const Eigen::Isometry3d& X_FR, const std::vector<bool>& wanted, SnapshotSpan clouds,
           Span<const PosedWorld* const> worlds, double obstacle_speed, double obstacle_age,
           std::vector<LinkClearance>* results);

  /// Sets the robot's surfaces, which worlds are measured with.
  /// @param surfaces  of the model that this was made with, or of one of the same geometry
  /// @param margins   [m] by link, see WorldQuery::set_link_margins
  void set_surfaces(std::shared_ptr<const RobotSurfaces> surfaces, std::vector<double> margins);

  /// Takes effect at the next run().
  void set_config(const QueryConfig& config);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
