#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/facade/obstacles.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/joint_trajectory.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// How a robot is read and packed.
struct RobotConfig {
  GeometrySource geometry = GeometrySource::kCollision;  ///< elements that shapes are read from
  PackingConfig packing;                                 ///< settings of every link's packing
  std::string cache_directory;                           ///< empty: no cache
  std::vector<std::string> links;  ///< monitored links; empty: every link that has geometry
  /// Empty: `package_dirs`, then environment_package_finder(). A relative path of a mesh starts
  /// from the folder of the URDF's file, or from find_package("").
  PackageFinder find_package;
  /// Folders in which packages are looked for by the names of their folders.
  std::vector<std::string> package_dirs;
  /// Whether a robot with links that cannot be used is made all the same. They are UNKNOWN, and
  /// nearest() has no lower bound.
  bool allow_unknown_links = false;
  bool distance_fields = true;    ///< see RobotModelConfig
  RobotModelCallbacks callbacks;  ///< progress, warnings, cancelling
};

/// How many configurations are answered.
struct BatchConfig {
  QueryConfig query;  ///< settings of every query
  int threads = 0;    ///< 0: as many as there are cores
};

/// A robot that tells its distances to obstacles, without ROS:
///
///     const ist::Robot robot("arm.urdf");
///     const ist::Obstacles obstacles(points);
///     for (const ist::LinkProximity& link : robot.distances(q, obstacles)) ...
///
/// A configuration q is one position [rad, m] for each of joints(), NaN where it is not known: the
/// links that it moves are UNKNOWN then. Mimic joints follow; one that does not is stated by
/// configuration(), for the calls that answer a single configuration. The fixed frame is the root
/// link's.
///
/// Immutable and thread safe; copies share everything. A call takes a query object from a pool that
/// grows to the number of threads that ask at a time, so it may allocate and locks briefly. A
/// control loop uses ProximityQuery itself, which does neither.
class Robot {
 public:
  /// Reads and packs a robot.
  /// @param urdf  path of a URDF file, or its text
  /// @throws ModelError when the URDF cannot be read, packing settings are out of range, a link is
  ///         faulty (`allow_unknown_links`: all are), or building was cancelled
  explicit Robot(const std::string& urdf, const RobotConfig& config = {});

  const std::string& name() const;                  ///< name of the robot in the URDF
  const std::vector<std::string>& links() const;    ///< monitored links, in the order of answers
  const std::vector<std::string>& joints() const;   ///< joints with a position of their own
  const std::vector<double>& lower_limits() const;  ///< [rad, m] by joint, may be -inf
  const std::vector<double>& upper_limits() const;  ///< [rad, m] by joint, may be +inf

  /// A configuration by joint names. Where a mimic joint is among them, positions of the mimic
  /// joints follow those of joints(): NaN for one that is not named and follows.
  /// @param other  [rad, m] position of joints() that are not named
  /// @throws std::invalid_argument when the robot has no such joint, or it has no position
  std::vector<double> configuration(const std::map<std::string, double>& positions,
                                    double other = 0.0) const;

  /// Forward kinematics.
  /// @throws std::invalid_argument when q has not as many numbers as there are joints
  LinkPoses link_poses(Span<const double> q) const;

  /// One answer for each link.
  /// @throws std::invalid_argument when q has not as many numbers as there are joints, or a setting
  ///         is out of range
  std::vector<LinkProximity> distances(Span<const double> q, const Obstacles& obstacles,
                                       const QueryConfig& config = {}) const;

  /// The nearest link only; the others are asked as far as that needs. Where a link is not known
  /// its lower bound is -inf (RobotProximity).
  /// @throws std::invalid_argument as distances()
  RobotProximity nearest(Span<const double> q, const Obstacles& obstacles,
                         const QueryConfig& config = {}) const;

  /// distances() of many configurations, on many threads.
  /// @param q  n configurations one after the other
  /// @returns n times the number of links, in the order of q
  /// @throws std::invalid_argument as distances()
  std::vector<LinkProximity> distances_batch(Span<const double> q, const Obstacles& obstacles,
                                             const BatchConfig& config = {}) const;

  /// nearest() of many configurations, on many threads.
  /// @returns n
  /// @throws std::invalid_argument as distances()
  std::vector<RobotProximity> nearest_batch(Span<const double> q, const Obstacles& obstacles,
                                            const BatchConfig& config = {}) const;

  /// Distances at poses of the links, from any kinematics.
  /// @param X_FL  n times the number of links: link frame -> fixed frame, rigid to 1e-6; a pose
  ///              that is not finite makes its link UNKNOWN
  /// @returns n times the number of links
  /// @throws std::invalid_argument when the number of poses is no multiple of the number of links,
  ///         a finite pose is not rigid, or a setting is out of range
  std::vector<LinkProximity> distances_at(Span<const Eigen::Isometry3d> X_FL,
                                          const Obstacles& obstacles,
                                          const BatchConfig& config = {}) const;

  /// First contacts, clearances and their gradients along trajectories, on many threads; the
  /// obstacles stand still.
  /// @param trajectories  by joint of joints(); mimic joints follow
  /// @returns as many times the number of links, in the order of the trajectories
  /// @throws std::invalid_argument when sizes differ, times do not rise, numbers are not finite, or
  ///         as distances()
  std::vector<LinkClearance> clearance(Span<const JointTrajectory> trajectories,
                                       const Obstacles& obstacles,
                                       const BatchConfig& config = {}) const;

  const RobotDescription& description() const;                  ///< what the URDF states
  const std::shared_ptr<const RobotModel>& model() const;       ///< the packed links
  const std::shared_ptr<const Kinematics>& kinematics() const;  ///< of the description

  /// The robot with its shapes and packings, for another process or machine.
  std::string to_bytes() const;
  /// @param bytes  of to_bytes(), by the same release
  /// @throws ModelError when they are cut off or changed
  static Robot from_bytes(const std::string& bytes);

 private:
  struct Impl;
  explicit Robot(std::shared_ptr<const Impl> impl);

  std::shared_ptr<const Impl> impl_;  // not null
};

}  // namespace ist
