#include "ros/poses/link_placer.h"

namespace ist {

LinkPlacer::LinkPlacer(std::shared_ptr<const Kinematics> kinematics,
                       const std::vector<std::string>& links)
    : kinematics_(std::move(kinematics)) {
  const std::size_t none = kinematics_->links().size();
  for (const std::string& name : links) {
    index_.push_back(kinematics_->find_link(name).value_or(none));
  }
}

void LinkPlacer::reset() {
  X_FL_.assign(kinematics_->links().size(), Eigen::Isometry3d::Identity());
  known_.assign(X_FL_.size(), false);
}

void LinkPlacer::place(const JointPoses& joints, const Eigen::Isometry3d& X_FR,
                       const std::vector<bool>& wanted,
                       const std::vector<std::string>& joint_problems, LinkPoses* poses) {
  kinematics_->place_links(joints, X_FR, &X_FL_, &known_);
  for (std::size_t i = 0; i < index_.size(); ++i) {
    if (!wanted[i]) continue;
    if (index_[i] == X_FL_.size()) {
      poses->problems[i] = "it is not in the URDF";
    } else if (known_[index_[i]]) {
      poses->X_FL[i] = X_FL_[index_[i]];
      poses->known[i] = true;
    } else {
      poses->problems[i] = joint_problems[*kinematics_->first_unknown(joints, index_[i])];
    }
  }
}

}  // namespace ist
