#include "ist_proximity/robot/link_poses.h"

#include <utility>

namespace ist {
namespace {

// By body: the first body of the group that fixed joints connect it with.
std::vector<std::size_t> rigid_groups(const Kinematics& kinematics) {
  std::vector<std::size_t> group(kinematics.bodies().size());
  for (const Kinematics::Joint& joint : kinematics.joints()) {
    group[joint.child] = joint.type == JointType::kFixed ? group[joint.parent] : joint.child;
  }
  return group;
}

}  // namespace

ForwardKinematics::ForwardKinematics(const RobotModel& model,
                                     std::shared_ptr<const Kinematics> kinematics)
    : kinematics_(std::move(kinematics)) {
  for (const LinkModel& link : model.links) {
    body_of_link_.push_back(kinematics_->find_body(link.name));
  }
  links_.X_FL.resize(model.links.size(), Eigen::Isometry3d::Identity());
  links_.known.resize(model.links.size(), false);
}

const LinkPoses& ForwardKinematics::run(const std::vector<double>& q,
                                        const Eigen::Isometry3d& X_FR) {
  kinematics_->place_joints(q, &joints_);
  return run(joints_, X_FR);
}

const LinkPoses& ForwardKinematics::run(const JointPoses& joints, const Eigen::Isometry3d& X_FR) {
  kinematics_->place_bodies(joints, X_FR, &bodies_);
  for (std::size_t i = 0; i < body_of_link_.size(); ++i) {
    const std::optional<std::size_t>& body = body_of_link_[i];
    links_.known[i] = body && bodies_.known[*body];
    if (links_.known[i]) links_.X_FL[i] = bodies_.X_FB[*body];
  }
  return links_;
}

LinkPoses link_poses(const RobotModel& model, const Kinematics& kinematics,
                     const std::vector<double>& q, const Eigen::Isometry3d& X_FR) {
  // The kinematics outlives this call, so the pointer does not own it.
  const std::shared_ptr<const Kinematics> view(std::shared_ptr<const Kinematics>(), &kinematics);
  return ForwardKinematics(model, view).run(q, X_FR);
}

std::vector<bool> links_that_move(const RobotModel& model, const Kinematics& kinematics,
                                  const std::string& body) {
  std::vector<bool> moves(model.links.size(), true);
  const auto frame = kinematics.find_body(body);
  if (!frame) return moves;
  const std::vector<std::size_t> group = rigid_groups(kinematics);
  for (std::size_t i = 0; i < moves.size(); ++i) {
    const auto link = kinematics.find_body(model.links[i].name);
    moves[i] = !link || group[*link] != group[*frame];
  }
  return moves;
}

}  // namespace ist
