#include "arm.h"

#include <algorithm>
#include <limits>
#include <stdexcept>

namespace ist::sim {

Arm::Arm(const RobotDescription& description, const ArmConfig& config)
    : kinematics_(description), config_(config) {
  for (const std::string& name : config.joints) {
    const auto joint = kinematics_.find_joint(name);
    if (!joint || !kinematics_.joints()[*joint].is_free()) {
      throw std::invalid_argument("joint '" + name +
                                  "' cannot be commanded: the URDF has no joint of this name "
                                  "that takes a position.");
    }
    joints_.push_back(*joint);
  }
  for (const LinkDescription& link : description.links) {
    bodies_.push_back(*kinematics_.find_body(link.name));
    bool moved = false;
    for (std::size_t b = bodies_.back(); b > 0; b = kinematics_.joints()[b - 1].parent) {
      const std::size_t source = kinematics_.joints()[b - 1].source;
      moved = moved || std::find(joints_.begin(), joints_.end(), source) != joints_.end();
    }
    moved_.push_back(moved);
  }
  reset(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(joints_.size())));
}

void Arm::reset(const Eigen::VectorXd& q) {
  q_ = q;
  dq_ = ddq_ = Eigen::VectorXd::Zero(q.size());
}

void Arm::step(const Eigen::VectorXd& command, double dt) {
  const double most = config_.max_acceleration * dt;
  for (Eigen::Index j = 0; j < q_.size(); ++j) {
    const Kinematics::Joint& joint = kinematics_.joints()[joints_[static_cast<std::size_t>(j)]];
    const double wanted = std::clamp(command[j], -config_.max_velocity, config_.max_velocity);
    const double before = dq_[j];
    dq_[j] += std::clamp(wanted - dq_[j], -most, most);
    q_[j] += dt * dq_[j];
    if (q_[j] < joint.lower || q_[j] > joint.upper) {
      q_[j] = std::clamp(q_[j], joint.lower, joint.upper);
      dq_[j] = 0.0;
    }
    ddq_[j] = (dq_[j] - before) / dt;
  }
}

std::vector<double> Arm::all_positions(const Eigen::VectorXd& q) const {
  std::vector<double> all(kinematics_.joints().size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t j = 0; j < all.size(); ++j) {
    if (kinematics_.joints()[j].is_free()) all[j] = config_.rest;
  }
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    all[joints_[j]] = q[static_cast<Eigen::Index>(j)];
  }
  return all;
}

std::vector<Eigen::Isometry3d> Arm::link_poses(const Eigen::VectorXd& q) const {
  JointPoses joint_poses;
  kinematics_.place_joints(all_positions(q), &joint_poses);
  BodyPoses bodies;
  kinematics_.place_bodies(joint_poses, Eigen::Isometry3d::Identity(), &bodies);
  std::vector<Eigen::Isometry3d> X_FL;
  X_FL.reserve(bodies_.size());
  for (const std::size_t body : bodies_) X_FL.push_back(bodies.X_FB[body]);
  return X_FL;
}

}  // namespace ist::sim
