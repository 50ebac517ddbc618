#include "ros/poses/link_placer.h"

namespace ist {

LinkPlacer::LinkPlacer(std::shared_ptr<const Kinematics> kinematics,
                       const std::vector<std::string>& links)
    : kinematics_(std::move(kinematics)) {
  const std::size_t none = kinematics_->bodies().size();
  for (const std::string& name : links) {
    index_.push_back(kinematics_->find_body(name).value_or(none));
  }
}

void LinkPlacer::reset() {
  bodies_.X_FB.assign(kinematics_->bodies().size(), Eigen::Isometry3d::Identity());
  bodies_.known.assign(bodies_.X_FB.size(), false);
}

void LinkPlacer::place(const JointPoses& joints, const Eigen::Isometry3d& X_FR,
                       const std::vector<bool>& wanted,
                       const std::vector<PoseProblem>& joint_problems, StampedLinkPoses* poses) {
  kinematics_->place_bodies(joints, X_FR, &bodies_);
  for (std::size_t i = 0; i < index_.size(); ++i) {
    if (!wanted[i]) continue;
    if (index_[i] == bodies_.X_FB.size()) {
      poses->problems[i] = {"it is not in the URDF", true};
    } else if (bodies_.known[index_[i]]) {
      poses->X_FL[i] = bodies_.X_FB[index_[i]];
      poses->known[i] = true;
    } else {
      poses->problems[i] = joint_problems[*kinematics_->first_unknown(joints, index_[i])];
    }
  }
}

}  // namespace ist
