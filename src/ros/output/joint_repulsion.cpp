#include "ros/output/joint_repulsion.h"

#include <limits>

namespace ist {

JointRepulsion::JointRepulsion(const ModelState& model)
    : kinematics_(model.kinematics), problem_(no_kinematics(model)) {
  if (!kinematics_) return;
  std::vector<std::size_t> links = model.monitored;
  links.insert(links.end(), model.paired.begin(), model.paired.end());
  for (const std::size_t i : links) {
    const auto found = kinematics_->find_body(model.robot->links[i].name);
    if (!found) continue;  // the URDF lacks this configured link, so nothing moves it
    links_.push_back(i);
    index_.push_back(*found);
  }
}

void JointRepulsion::fill(PoseSource* source, const std::vector<RepulsiveWrench>& pushes,
                          ist_proximity::JointRepulsion* message) {
  if (!kinematics_ || source == nullptr) {
    message->status = ist_proximity::ProximityArray::MODEL_ERROR;
    message->status_text = problem_;
    return;
  }
  source->look_up_all(*kinematics_, message->header.stamp, &bodies_);
  const auto& joints = kinematics_->joints();
  effort_.setZero(static_cast<Eigen::Index>(joints.size()));
  for (std::size_t i = 0; i < index_.size(); ++i) {
    const std::string why = add(index_[i], pushes[links_[i]]);
    if (why.empty() || message->status != ist_proximity::ProximityArray::OK) continue;
    message->status = ist_proximity::ProximityArray::NO_POSE;
    message->status_text = why;
  }
  for (std::size_t j = 0; j < joints.size(); ++j) {
    if (!joints[j].is_free()) continue;
    message->joints.push_back(joints[j].name);
    message->effort.push_back(effort_[static_cast<Eigen::Index>(j)]);
  }
}

std::string JointRepulsion::add(std::size_t body, const RepulsiveWrench& push) {
  if (push.force.isZero(0.0) && push.torque.isZero(0.0)) return "";
  if (!push.force.allFinite()) {  // the link is UNKNOWN, and the status of ~proximity says why
    set_unknown(body);
    return "";
  }
  const auto missing = first_body_needed(*kinematics_, bodies_.known, body);
  if (missing) {
    set_unknown(body);
    return "the joints' efforts from link '" + kinematics_->bodies()[body] +
           "' are not known: the pose of link '" + kinematics_->bodies()[*missing] +
           "' is not known";
  }
  point_jacobian(*kinematics_, bodies_.X_FB, body, bodies_.X_FB[body].translation(), &J_);
  Eigen::Matrix<double, 6, 1> wrench;
  wrench << push.force, push.torque;
  effort_ += J_.transpose() * wrench;
  return "";
}

/// Makes the efforts of all joints that move the link NaN.
void JointRepulsion::set_unknown(std::size_t body) {
  const auto& joints = kinematics_->joints();
  for (; body > 0; body = joints[body - 1].parent) {
    effort_[static_cast<Eigen::Index>(joints[body - 1].source)] =
        std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace ist
