#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/time_of_impact.h"
#include "support/scene.h"

/// Robots of primitives that move among points, and when they first touch one, by dense sampling.
namespace ist::test {

struct Arm {
  std::shared_ptr<const RobotModel> model;
  std::shared_ptr<const Kinematics> kinematics;
  std::vector<LinkGeometry> links;  ///< by link of the model
  std::vector<std::size_t> bodies;  ///< by link of the model: its body in the kinematics
  std::size_t size() const { return links.size(); }
};

struct ArmMotion {
  JointMotion joints;
  JointPoses still;
  Eigen::Isometry3d X_FR;
  std::vector<Eigen::Vector3d> points;  ///< [m] in the fixed frame
};

/// Shapes of links, packed.
struct LinkShapes {
  explicit LinkShapes(const std::vector<Shape>& all) : shapes(all), packed(make_model(all, 0.01)) {}

  std::vector<Shape> shapes;
  std::shared_ptr<const RobotModel> packed;
};

/// A link of a random one of the shapes at each body but the root.
Arm arm_of(const RobotDescription& robot, const LinkShapes& shapes, Rng* rng);

/// Up to five joints, links about as long as an arm's; a floating joint now and then.
Arm random_arm(Rng* rng);

/// One of its links.
std::size_t random_link(Rng* rng, const Arm& arm);

/// X_FB of all bodies, `time` [s] after the start.
std::vector<Eigen::Isometry3d> sampled_poses(const Arm& arm, const ArmMotion& motion, double time);

/// For 0.5 to 2 s, each joint up to 1.5 rad or 0.5 m, or standing still; five points or fewer, some
/// of them in the way.
ArmMotion random_motion(Rng* rng, const Arm& arm);

/// Smallest exact distance [m] of any link to any point, `time` [s] after the start.
double sampled_distance(const Arm& arm, const ArmMotion& motion, double time);

/// [s] The first time until `end` at which `distance` [m] is not positive: samples every half
/// millisecond, then bisection between the last one without and the first one with contact; +inf
/// without any. Far away some samples are spared: nothing here is faster than 40 m/s.
double sampled_contact(const std::function<double(double)>& distance, double end);

/// [s] The first contact of any link and any point, by samples.
double sampled_impact(const Arm& arm, const ArmMotion& motion);

/// Counts what does not start in contact, by how the time that was found differs from the true one.
struct ImpactCounts {
  int all = 0;
  int contacts = 0;  ///< with a contact
  int close = 0;     ///< no more than 5 ms early, or without a contact that was not found either
  int late = 0;      ///< later than the true time
  int alarms = 0;    ///< a time was found where there is no contact

  void add(double found, double truth);
};

}  // namespace ist::test
