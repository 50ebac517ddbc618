#include "ros/poses/kinematic_pose_source.h"

#include <utility>

namespace ist {

KinematicPoseSource::KinematicPoseSource(std::shared_ptr<const Kinematics> kinematics,
                                         const TransformBuffer& buffer, std::string fixed_frame,
                                         const std::vector<std::string>& links,
                                         std::vector<bool> wanted, double timeout)
    : kinematics_(std::move(kinematics)),
      buffer_(buffer),
      fixed_frame_(std::move(fixed_frame)),
      timeout_(timeout),
      wanted_(std::move(wanted)) {
  const std::size_t none = kinematics_->bodies().size();
  for (const std::string& name : links) {
    index_.push_back(kinematics_->find_body(name).value_or(none));
  }
}

void KinematicPoseSource::reset(const ros::Time& now, StampedLinkPoses* poses) {
  poses->reset(now, index_.size());
  bodies_.X_FB.assign(kinematics_->bodies().size(), Eigen::Isometry3d::Identity());
  bodies_.known.assign(bodies_.X_FB.size(), false);
}

void KinematicPoseSource::place(const std::vector<PoseProblem>& joint_problems,
                                StampedLinkPoses* poses) {
  kinematics_->place_bodies(joints_, X_FR_, &bodies_);
  for (std::size_t i = 0; i < index_.size(); ++i) {
    if (!wanted_[i]) continue;
    if (index_[i] == bodies_.X_FB.size()) {
      poses->problems[i] = {"it is not in the URDF", true};
    } else if (bodies_.known[index_[i]]) {
      poses->X_FL[i] = bodies_.X_FB[index_[i]];
      poses->known[i] = true;
    } else {
      poses->problems[i] = joint_problems[*kinematics_->first_unknown(joints_, index_[i])];
    }
  }
}

}  // namespace ist
