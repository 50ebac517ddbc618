#include "ros/filter/proximity_rows.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/numbers.h"
#include "ros/common/eigen_conversion.h"

namespace ist {
namespace {

// The box of a link's geometry; empty where the message states none.
Eigen::AlignedBox3d box_of(const ist_proximity::LinkProximity& message) {
  const Eigen::Vector3d center = to_vector(message.box_center), size = to_vector(message.box_size);
  if (!center.allFinite() || !size.allFinite()) return {};
  return {center - 0.5 * size, center + 0.5 * size};
}

bool is_same(const LinkBox& a, const LinkBox& b) {
  return a.link == b.link && a.box_L.min() == b.box_L.min() && a.box_L.max() == b.box_L.max();
}

}  // namespace

ProximityRows::ProximityRows(std::shared_ptr<const Kinematics> kinematics)
    : kinematics_(std::move(kinematics)), turns_(kinematics_->joints().size(), 0.0) {
  for (const Kinematics::Joint& joint : kinematics_->joints()) {
    if (joint.type != JointType::kFixed && !joint.has_unstated_pose()) {
      turns_[joint.source] += std::abs(joint.multiplier);
    }
  }
  build({});
}

void ProximityRows::build(const std::vector<LinkBox>& boxes) {
  boxes_ = boxes;
  builder_.emplace(boxes, kinematics_);
  results_.resize(boxes.size());
  obstacle_speeds_.resize(boxes.size());
}

void ProximityRows::set(const ist_proximity::ProximityArray::ConstPtr& answers,
                        const Eigen::Isometry3d& X_RF) {
  answers_ = answers;
  X_RF_ = X_RF;
  std::vector<LinkBox> boxes;
  for (const ist_proximity::LinkProximity& link : answers->links) {
    boxes.push_back({link.link, box_of(link)});
  }
  // An attached object, or a model that has been read again, changes the boxes.
  if (!std::equal(boxes.begin(), boxes.end(), boxes_.begin(), boxes_.end(), is_same)) build(boxes);
}

void ProximityRows::read(const ist_proximity::LinkProximity& message, LinkProximity* result) const {
  *result = LinkProximity();
  result->state = static_cast<LinkState>(
      std::min<std::uint8_t>(message.state, static_cast<std::uint8_t>(LinkState::kContact)));
  result->distance = message.distance;
  result->lower_bound = std::isnan(message.lower_bound) ? -kInfinity : message.lower_bound;
  result->p_FCl = X_RF_ * to_vector(message.point_on_link);
  result->p_FCo = X_RF_ * to_vector(message.point_on_obstacle);
  result->direction = X_RF_.linear() * to_vector(message.direction);
}

void ProximityRows::place(const std::vector<double>& q, BodyPoses* poses) {
  kinematics_->place_joints(q, &joint_poses_);
  kinematics_->place_bodies(joint_poses_, Eigen::Isometry3d::Identity(), poses);
}

double ProximityRows::motion(std::size_t row, const std::vector<double>& q_then,
                             const std::vector<double>& q_now) const {
  double moved = 0.0, turned = 0.0;
  const auto& joints = builder_->joints();
  for (std::size_t c = 0; c < joints.size(); ++c) {
    const double step = std::abs(q_now[joints[c]] - q_then[joints[c]]);
    const double sweep =
        builder_->rows().sweep(static_cast<Eigen::Index>(row), static_cast<Eigen::Index>(c));
    if (!(sweep > 0.0)) continue;
    moved += sweep * step;
    turned += turns_[joints[c]] * step;
  }
  return turned < 0.5 ? moved / (1.0 - turned) : kInfinity;  // also where a position is not known
}

const ConstraintRows& ProximityRows::rows(const std::vector<double>& q_then,
                                          const std::vector<double>& q_now, RowConfig config) {
  for (std::size_t i = 0; i < results_.size(); ++i) {
    read(answers_->links[i], &results_[i]);
    obstacle_speeds_[i] = std::max(0.0, answers_->links[i].closing_speed_obstacles);
  }
  place(q_then, &then_);
  place(q_now, &now_);
  builder_->begin(then_, config);
  builder_->add_links(results_, obstacle_speeds_);
  const ConstraintRows& rows = builder_->rows();
  for (std::size_t row = 0; row < rows.count; ++row) {
    const auto link = static_cast<std::size_t>(rows.origins[row].index);
    results_[link].lower_bound -= motion(row, q_then, q_now);
  }
  for (std::size_t i = 0; i < results_.size(); ++i) {
    const auto body = kinematics_->find_body(boxes_[i].link);
    if (!body || !then_.known[*body] || !now_.known[*body]) continue;
    results_[i].p_FCl = now_.X_FB[*body] * (then_.X_FB[*body].inverse() * results_[i].p_FCl);
  }
  builder_->begin(now_, config);
  builder_->add_links(results_, obstacle_speeds_);
  return builder_->rows();
}

}  // namespace ist
