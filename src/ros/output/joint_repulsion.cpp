#include "ros/output/joint_repulsion.h"

#include <limits>

namespace ist {

JointRepulsion::JointRepulsion(const ModelState& model)
    : kinematics_(model.kinematics), problem_(model.kinematics_problem) {
  if (!kinematics_) return;
  for (const std::size_t i : model.monitored) {
    const auto place = kinematics_->find_body(model.robot->links[i].name);
    if (!place) continue;  // a configured link that the URDF lacks: nothing moves it
    monitored_.push_back(i);
    places_.push_back(*place);
  }
}

void JointRepulsion::fill(PoseSource* source, const std::vector<RepulsiveWrench>& pushes,
                          const ist_proximity::ProximityArray& proximity,
                          ist_proximity::JointRepulsion* message) {
  message->header.stamp = proximity.header.stamp;
  message->status = proximity.status;
  message->status_text = proximity.status_text;
  message->joints.clear();
  message->effort.clear();
  if (!kinematics_ || source == nullptr) {
    message->status = ist_proximity::ProximityArray::MODEL_ERROR;
    message->status_text = "of the URDF, " + problem_;
    return;
  }
  source->look_up_all(*kinematics_, proximity.header.stamp, &bodies_);
  const auto& joints = kinematics_->joints();
  effort_.setZero(static_cast<Eigen::Index>(joints.size()));
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const std::string why = add(places_[i], pushes[monitored_[i]]);
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

std::string JointRepulsion::add(std::size_t place, const RepulsiveWrench& push) {
  if (push.force.isZero(0.0) && push.torque.isZero(0.0)) return "";
  if (!push.force.allFinite()) {  // UNKNOWN: the status of the proximity message says why
    blame(place);
    return "";
  }
  const auto missing = first_body_needed(*kinematics_, bodies_.known, place);
  if (missing) {
    blame(place);
    return "the joints' efforts from link '" + kinematics_->bodies()[place] +
           "' are not known: where link '" + kinematics_->bodies()[*missing] + "' is is not known";
  }
  point_jacobian(*kinematics_, bodies_.X_FB, place, bodies_.X_FB[place].translation(), &J_);
  Eigen::Matrix<double, 6, 1> wrench;
  wrench << push.force, push.torque;
  effort_ += J_.transpose() * wrench;
  return "";
}

/// The efforts of all joints that move the link are not known.
void JointRepulsion::blame(std::size_t place) {
  const auto& joints = kinematics_->joints();
  for (; place > 0; place = joints[place - 1].parent) {
    effort_[static_cast<Eigen::Index>(joints[place - 1].source)] =
        std::numeric_limits<double>::quiet_NaN();
  }
}

}  // namespace ist
