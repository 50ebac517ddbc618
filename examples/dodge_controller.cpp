#include "dodge_controller.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "ist_proximity/robot/kinematics.h"

namespace ist::example {
namespace {

constexpr int kSweeps = 40;

Eigen::VectorXd commanded(const ControlledArm& arm, const std::vector<double>& all) {
  Eigen::VectorXd q(static_cast<Eigen::Index>(arm.joints.size()));
  for (std::size_t j = 0; j < arm.joints.size(); ++j) {
    q[static_cast<Eigen::Index>(j)] = all[arm.joints[j]];
  }
  return q;
}

/// The constraint a . x >= b, which yields a little where `softness_sq` is not 0.
struct Constraint {
  Eigen::VectorXd a;
  double b = 0.0;
  double softness_sq = 0.0;
  double force = 0.0;  // Lagrange multiplier
};

/// The x nearest to `wanted` that keeps the constraints: Hildreth's method on the dual problem.
Eigen::VectorXd nearest_to(const Eigen::VectorXd& wanted, std::vector<Constraint>* constraints) {
  Eigen::VectorXd x = wanted;
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    for (Constraint& c : *constraints) {
      const double lack = c.b - c.a.dot(x) - c.softness_sq * c.force;
      const double size = c.a.squaredNorm() + c.softness_sq;
      const double force = std::max(0.0, c.force + lack / size);
      x += (force - c.force) * c.a;
      c.force = force;
    }
  }
  return x;
}

/// The velocity toward the goal; all joints arrive together.
Eigen::VectorXd toward(const Eigen::VectorXd& q, const Eigen::VectorXd& goal, double speed_scale,
                       const DodgeConfig& config) {
  const Eigen::VectorXd wanted = config.task_gain * (goal - q);
  const double scale = speed_scale > 0.0 ? std::min(speed_scale, 1.0) : 0.0;  // 0 for NaN
  const double speed = config.task_speed * scale;
  const double fastest = wanted.cwiseAbs().maxCoeff();
  return fastest > speed ? Eigen::VectorXd(speed / fastest * wanted) : wanted;
}

void add_joint_limits(const ControlledArm& arm, const Eigen::VectorXd& q, const DodgeConfig& config,
                      std::vector<Constraint>* constraints) {
  for (Eigen::Index j = 0; j < q.size(); ++j) {
    const Kinematics::Joint& joint =
        arm.kinematics.joints()[arm.joints[static_cast<std::size_t>(j)]];
    const auto bound = [&](double margin) {
      return std::clamp(config.limit_gain * margin, 0.0, config.max_joint_speed);
    };
    Constraint c;
    c.a = Eigen::VectorXd::Unit(q.size(), j);
    c.b = -bound(q[j] - joint.lower);
    constraints->push_back(c);
    c.a = -c.a;
    c.b = -bound(joint.upper - q[j]);
    constraints->push_back(c);
  }
}

}  // namespace

ControlledArm::ControlledArm(const RobotDescription& description,
                             const std::vector<std::string>& joint_names)
    : kinematics(description) {
  for (const std::string& name : joint_names) {
    const auto joint = kinematics.find_joint(name);
    if (!joint || !kinematics.joints()[*joint].is_free()) {
      throw std::invalid_argument("joint '" + name +
                                  "' cannot be commanded: the URDF has no joint of this name "
                                  "that takes a position.");
    }
    joints.push_back(*joint);
  }
}

bool is_known(const Reading& reading, const DodgeConfig& config) {
  const bool is_fresh = reading.message_age <= config.max_message_age &&
                        reading.cloud_age <= config.max_cloud_age;  // false for NaN
  return reading.is_ok && is_fresh && !reading.links.empty() &&
         std::all_of(reading.links.begin(), reading.links.end(),
                     [](const LinkReading& link) { return std::isfinite(link.lower_bound); });
}

bool has_reached(const ControlledArm& arm, const std::vector<double>& q,
                 const Eigen::VectorXd& goal, const DodgeConfig& config) {
  return (commanded(arm, q) - goal).cwiseAbs().maxCoeff() < config.reached;
}

Eigen::VectorXd dodge(const ControlledArm& arm, const std::vector<double>& all_q,
                      const Eigen::VectorXd& goal, const Reading& reading,
                      const DodgeConfig& config) {
  const Eigen::VectorXd q = commanded(arm, all_q);
  if (!is_known(reading, config) || !q.allFinite()) return Eigen::VectorXd::Zero(q.size());

  JointPoses joint_poses;
  BodyPoses bodies;
  arm.kinematics.place_joints(all_q, &joint_poses);
  arm.kinematics.place_bodies(joint_poses, Eigen::Isometry3d::Identity(), &bodies);

  std::vector<Constraint> constraints;
  Jacobian J;
  for (const LinkReading& link : reading.links) {
    const double length = link.away.norm();
    if (!bodies.known[link.body] || !link.p_LCl.allFinite() || !(length > 0.0)) continue;
    point_jacobian(arm.kinematics, bodies.X_FB, link.body, bodies.X_FB[link.body] * link.p_LCl, &J);
    Constraint c;
    c.a.resize(q.size());
    bool can_move = false;
    for (std::size_t j = 0; j < arm.joints.size(); ++j) {
      const auto column = J.topRows<3>().col(static_cast<Eigen::Index>(arm.joints[j]));
      c.a[static_cast<Eigen::Index>(j)] = column.dot(link.away) / length;
      can_move = can_move || !column.isZero();
    }
    if (!can_move) continue;
    c.b = std::min(config.damping * (config.keep_distance - link.lower_bound), config.escape_speed);
    c.softness_sq = config.softness * config.softness;
    constraints.push_back(c);
  }
  add_joint_limits(arm, q, config, &constraints);
  return nearest_to(toward(q, goal, reading.speed_scale, config), &constraints);
}

}  // namespace ist::example
