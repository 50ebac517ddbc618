#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "arm.h"
#include "depth_camera.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/geometry/solid.h"
#include "obstacle.h"

namespace ist::sim {

/// A depth image that has arrived.
struct Picture {
  std::size_t camera = 0;  ///< index
  double stamp = 0.0;      ///< [s] time of exposure
  int width = 0, height = 0;
  std::vector<Eigen::Vector3f> points;  ///< see DepthCamera::picture

  RawCloud raw() const;  ///< refers to `points`
};

/// A kinematic arm among obstacles, and depth cameras that see both, in steps of one millisecond.
/// Deterministic: the same arguments give the same images. The robot's root link is the fixed
/// frame F.
class Simulation {
 public:
  Simulation(const RobotDescription& robot, const ArmConfig& arm,
             const std::vector<Obstacle>& obstacles, const std::vector<DepthCameraConfig>& cameras,
             std::uint64_t seed);

  /// Advances by one step.
  /// @param command  [rad/s, m/s] by commanded joint
  void step(const Eigen::VectorXd& command);
  static constexpr double kStep = 0.001;  ///< [s]

  double time() const { return kStep * static_cast<double>(steps_); }  ///< [s] since the start
  Arm& arm() { return arm_; }
  const Arm& arm() const { return arm_; }
  const std::vector<DepthCamera>& cameras() const { return cameras_; }
  const std::vector<Obstacle>& obstacles() const { return obstacles_; }

  /// Images that have arrived since the last call.
  std::vector<Picture> take_pictures();
  /// Starts or stops all cameras; stopped cameras take no images.
  void set_cameras_alive(bool alive) { cameras_alive_ = alive; }

  /// Poses of the links with geometry, now and at the step nearest to an instant [s] at most two
  /// seconds ago.
  std::vector<Eigen::Isometry3d> link_poses() const { return arm_.link_poses(arm_.positions()); }
  std::vector<Eigen::Isometry3d> link_poses(double time) const;

  /// [m] Centre of a link's bounding sphere, in the fixed frame.
  Eigen::Vector3d middle(std::size_t link, const Eigen::Isometry3d& X_FL) const {
    return X_FL * bodies_[link].center;
  }

  /// The nearest link and obstacle, and their exact distance.
  struct Truth {
    double distance;  ///< [m] inf: none within the range asked for
    std::size_t link = 0, obstacle = 0;
  };
  /// The minimum over the links that commanded joints move and all obstacles.
  Truth nearest(double max_distance) const { return nearest_then(max_distance, time()); }
  /// The same for the arm as it is now and the obstacles as they are at another time [s].
  Truth nearest_then(double max_distance, double when) const;

 private:
  struct Element {
    std::size_t link;
    RayShape shape;
    Eigen::Isometry3d X_LE;
  };
  struct LinkBody {
    Solid solid;
    Eigen::Vector3d center;  // [m] of a bounding sphere, link frame
    double radius;
  };

  void take_pictures_now();

  Arm arm_;
  std::vector<Obstacle> obstacles_;
  std::vector<Element> elements_;
  std::vector<LinkBody> bodies_;  // by link
  std::vector<RayShape> seen_obstacles_;
  std::vector<DepthCamera> cameras_;
  std::vector<std::int64_t> next_picture_;  // by camera, in steps
  std::deque<Picture> under_way_;
  std::deque<Eigen::VectorXd> history_;  // positions, newest last
  std::int64_t steps_ = 0;
  bool cameras_alive_ = true;
  Rng rng_;
};

}  // namespace ist::sim
