#include "ros/cycle/late_joints.h"

#include <utility>

#include "ist_proximity/proximity/stopping_reach.h"

namespace ist {

LateJoints::LateJoints(std::shared_ptr<const Kinematics> kinematics,
                       const std::vector<LinkBox>& boxes)
    : kinematics_(std::move(kinematics)), boxes_(boxes) {
  if (!kinematics_) return;
  for (const LinkBox& box : boxes_) {
    links_.push_back(kinematics_->find_body(box.link).value_or(0));
  }
}

Span<const double> LateJoints::update(PoseSource* source, const ros::Time& instant,
                                      const std::vector<bool>& known) {
  lags_.clear();
  if (!kinematics_ || source == nullptr || source->joint_lags().empty()) return {};
  lags_.assign(source->joint_lags().begin(), source->joint_lags().end());
  source->look_up_all(*kinematics_, instant, &bodies_);
  moved_.assign(links_.size(), 0.0);
  for (std::size_t i = 0; i < links_.size(); ++i) {
    if (i >= known.size() || !known[i]) continue;
    moved_[i] =
        stopping_reach(*kinematics_, lags_, links_[i], boxes_[i].box_L, bodies_.X_FB).distance;
  }
  return moved_;
}

double LateJoints::approach(std::size_t first, std::size_t second) {
  if (lags_.empty()) return 0.0;
  double moved = 0.0;
  for (const auto& [link, other] : {std::pair(first, second), std::pair(second, first)}) {
    own_ = lags_;
    for (std::size_t at = links_[other]; at != 0; at = kinematics_->joints()[at - 1].parent) {
      own_[at - 1] = {0.0, 0.0, 0.0};
    }
    moved +=
        stopping_reach(*kinematics_, own_, links_[link], boxes_[link].box_L, bodies_.X_FB).distance;
  }
  return moved;
}

}  // namespace ist
