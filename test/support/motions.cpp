#include "support/motions.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "support/random_links.h"
#include "support/random_robots.h"
#include "support/shape_oracle.h"

namespace ist::test {

Arm arm_of(const RobotDescription& robot, const LinkShapes& shapes, Rng* rng) {
  Arm arm;
  const auto model = std::make_shared<RobotModel>();
  arm.kinematics = std::make_shared<Kinematics>(robot);
  const double last = static_cast<double>(shapes.shapes.size()) - 0.001;
  for (std::size_t i = 1; i < arm.kinematics->bodies().size(); ++i) {
    const auto shape = static_cast<std::size_t>(uniform(rng, 0, last));
    model->links.push_back(shapes.packed->links[shape]);
    model->links.back().name = arm.kinematics->bodies()[i];
    arm.links.push_back(one(shapes.shapes[shape]));
    arm.bodies.push_back(i);
  }
  arm.model = model;
  return arm;
}

Arm random_arm(Rng* rng) {
  static const LinkShapes kShapes(
      {Box{{0.1, 0.06, 0.3}}, Cylinder{0.05, 0.25}, Sphere{0.08}, Box{{0.2, 0.2, 0.02}}});
  RobotDescription robot = random_robot(rng, 5);
  for (JointDescription& joint : robot.joints) joint.X_PJ.translation() *= 0.4;
  if (uniform(rng, 0, 1) < 0.1 && robot.joints.size() > 1) {
    JointDescription& first = robot.joints[0];
    first.type = JointType::kFloating;
    for (JointDescription& joint : robot.joints) {
      if (joint.mimic && joint.mimic->joint == first.name) joint.mimic.reset();
    }
  }
  return arm_of(robot, kShapes, rng);
}

std::size_t random_link(Rng* rng, const Arm& arm) {
  return static_cast<std::size_t>(uniform(rng, 0, 0.999) * static_cast<double>(arm.size()));
}

std::vector<Eigen::Isometry3d> sampled_poses(const Arm& arm, const ArmMotion& motion, double time) {
  const auto& joints = arm.kinematics->joints();
  const double s = time / motion.joints.duration;
  JointPoses poses = motion.still;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (joints[j].has_unstated_pose() || joints[j].type == JointType::kFixed) continue;
    const auto end = [&](const std::vector<double>& q) {  // a mimic is where it is stated
      return std::isnan(q[j]) ? joints[j].multiplier * q[joints[j].source] + joints[j].offset
                              : q[j];
    };
    const double q = (1.0 - s) * end(motion.joints.from) + s * end(motion.joints.to);
    if (!std::isnan(q)) poses.X_PC[j] = arm.kinematics->joint_pose(j, q);
  }
  BodyPoses bodies;
  arm.kinematics->place_bodies(poses, motion.X_FR, &bodies);
  return bodies.X_FB;
}

ArmMotion random_motion(Rng* rng, const Arm& arm) {
  ArmMotion motion;
  motion.joints.duration = uniform(rng, 0.5, 2.0);
  motion.X_FR = random_pose(rng, 0.5);
  std::vector<double> q;
  for (const Kinematics::Joint& joint : arm.kinematics->joints()) {
    const double way = joint.type == JointType::kPrismatic ? 0.25 : 1.5;
    q.push_back(uniform(rng, -1, 1));
    const bool stands = uniform(rng, 0, 1) < 0.2;
    motion.joints.from.push_back(stands ? std::nan("") : q.back());
    motion.joints.to.push_back(stands ? std::nan("") : q.back() + uniform(rng, -way, way));
  }
  arm.kinematics->place_joints(q, &motion.still);
  for (std::size_t j = 0; j < q.size(); ++j) {
    if (!arm.kinematics->joints()[j].has_unstated_pose()) continue;
    motion.still.X_PC[j] = random_pose(rng, 0.3);
    motion.still.known[j] = true;
  }
  const int count = 1 + static_cast<int>(uniform(rng, 0, 5));
  for (int i = 0; i < count; ++i) {
    const std::size_t body = arm.bodies[random_link(rng, arm)];
    const double time = uniform(rng, 0.3, 1.2) * motion.joints.duration;
    motion.points.push_back(sampled_poses(arm, motion, time)[body] * random_vector(rng, 0.1));
  }
  return motion;
}

double sampled_distance(const Arm& arm, const ArmMotion& motion, double time) {
  const std::vector<Eigen::Isometry3d> X_FB = sampled_poses(arm, motion, time);
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < arm.size(); ++i) {
    smallest = std::min(smallest, oracle_minimum(arm.links[i], X_FB[arm.bodies[i]], motion.points));
  }
  return smallest;
}

double sampled_contact(const std::function<double(double)>& distance, double end) {
  constexpr double kStep = 5e-4, kFastest = 40.0;
  double before = 0.0;
  for (double time = 0.0; time <= end;) {
    const double now = distance(time);
    if (now <= 0.0) {
      while (time - before > 1e-9) {
        const double middle = 0.5 * (before + time);
        (distance(middle) <= 0.0 ? time : before) = middle;
      }
      return time;
    }
    before = time;
    time += kStep * std::max(1.0, std::floor(now / (kFastest * kStep)));
  }
  return std::numeric_limits<double>::infinity();
}

double sampled_impact(const Arm& arm, const ArmMotion& motion) {
  return sampled_contact([&](double time) { return sampled_distance(arm, motion, time); },
                         motion.joints.duration);
}

void ImpactCounts::add(double found, double truth) {
  ++all;
  late += found > truth ? 1 : 0;
  if (std::isinf(truth)) {
    alarms += std::isinf(found) ? 0 : 1;
    close += std::isinf(found) ? 1 : 0;
    return;
  }
  ++contacts;
  close += truth - found <= 0.005 ? 1 : 0;
}

}  // namespace ist::test
