#include "ist_proximity/robot/kinematics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <sstream>
#include <string>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

bool has_position(JointType type) {
  return type == JointType::kRevolute || type == JointType::kContinuous ||
         type == JointType::kPrismatic;
}

std::string title(const std::string& joint) { return "joint '" + joint + "'"; }

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

Kinematics::Joint make_joint(const JointDescription& description, std::size_t parent,
                             std::size_t index) {
  Kinematics::Joint joint;
  joint.name = description.name;
  joint.type = description.type;
  joint.parent = parent;
  joint.child = index + 1;
  joint.X_PJ = description.X_PJ;
  if (!joint.X_PJ.matrix().allFinite()) {
    throw ModelError(title(joint.name) + ": its <origin> is not finite");
  }
  const std::string fault = position_fault("its <origin>", joint.X_PJ.translation());
  if (!fault.empty()) throw ModelError(title(joint.name) + ": " + fault);
  joint.axis = description.axis;
  if (has_position(joint.type)) {
    const double length = description.axis.norm();
    if (!std::isfinite(length) || length < 1e-9) {
      throw ModelError(title(joint.name) + ": its <axis> has length " + std::to_string(length) +
                       "; it must be a direction");
    }
    joint.axis /= length;
  }
  joint.lower = description.lower;
  joint.upper = description.upper;
  joint.speed = description.speed;
  joint.source = index;
  joint.multiplier = 1.0;
  joint.offset = 0.0;
  joint.leader = index;
  return joint;
}

}  // namespace

bool Kinematics::Joint::is_free() const { return has_position(type) && source + 1 == child; }

double Kinematics::Joint::way(double from, double to) const {
  return type == JointType::kContinuous ? std::remainder(to - from, 2.0 * EIGEN_PI) : to - from;
}

Kinematics::Kinematics(const RobotDescription& description) {
  add_tree(description);
  resolve_mimics(description);
  has_geometry_.assign(bodies_.size(), false);
  for (const LinkDescription& link : description.links) {
    const auto body = find_body(link.name);
    if (body) has_geometry_[*body] = link.geometry.size() > link.attached || !link.error.empty();
  }
}

/// Breadth first, so that every body comes after its parent.
void Kinematics::add_tree(const RobotDescription& description) {
  std::multimap<std::string, const JointDescription*> below;
  for (const JointDescription& joint : description.joints) {
    below.insert({joint.parent_link, &joint});
  }
  bodies_ = {description.root_link};
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    const std::string parent = bodies_[i];  // a copy: bodies_ grows
    const auto [first, last] = below.equal_range(parent);
    for (auto entry = first; entry != last; ++entry) {
      joints_.push_back(make_joint(*entry->second, i, joints_.size()));
      bodies_.push_back(entry->second->child_link);
    }
  }
  for (std::size_t i = 0; i < bodies_.size(); ++i) body_of_name_.insert({bodies_[i], i});
  for (std::size_t i = 0; i < joints_.size(); ++i) joint_of_name_.insert({joints_[i].name, i});
  assert(joints_.size() == description.joints.size() && "parse_urdf has checked that it is a tree");
}

/// A joint that another joint follows may follow one itself. Each joint is resolved once, from the
/// end of its chain back, so that long chains take no longer than short ones.
void Kinematics::resolve_mimics(const RobotDescription& description) {
  std::unordered_map<std::string, const JointDescription*> by_name;
  for (const JointDescription& joint : description.joints) by_name[joint.name] = &joint;
  std::vector<bool> is_resolved(joints_.size(), false), is_in_chain(joints_.size(), false);
  for (std::size_t first = 0; first < joints_.size(); ++first) {
    if (!has_position(joints_[first].type)) continue;
    std::vector<std::size_t> chain;
    std::size_t at = first;
    for (; !is_resolved[at] && by_name.at(joints_[at].name)->mimic; at = chain.back()) {
      if (is_in_chain[at]) {
        throw ModelError(title(joints_[first].name) +
                         " follows joints that mimic one another in a ring");
      }
      is_in_chain[at] = true;
      chain.push_back(at);
      chain.push_back(followed_joint(*by_name.at(joints_[at].name)));
    }
    is_resolved[at] = true;
    // `chain` holds pairs of a joint and the one that it follows.
    for (std::size_t k = chain.size(); k > 0; k -= 2) {
      Joint& joint = joints_[chain[k - 2]];
      const Joint& source = joints_[chain[k - 1]];
      const Mimic& mimic = *by_name.at(joint.name)->mimic;
      joint.source = source.source;
      joint.multiplier = mimic.multiplier * source.multiplier;
      joint.offset = mimic.multiplier * source.offset + mimic.offset;
      joint.leader = chain[k - 1];
      joint.mimic = mimic;
      mimics_.push_back(chain[k - 2]);
      is_resolved[chain[k - 2]] = true;
    }
  }
}

/// The joint that this one mimics.
std::size_t Kinematics::followed_joint(const JointDescription& joint) const {
  const Mimic& mimic = *joint.mimic;
  if (!(std::abs(mimic.multiplier) <= kMaxScale) || !(std::abs(mimic.offset) <= kMaxLength)) {
    throw ModelError(title(joint.name) + ": multiplier " + number(mimic.multiplier) +
                     " or offset " + number(mimic.offset) +
                     " of its <mimic> is not finite or larger than 10000");
  }
  const std::optional<std::size_t> followed = find_joint(mimic.joint);
  if (!followed) {
    throw ModelError(title(joint.name) + " mimics " + title(printable(mimic.joint)) +
                     ", which is not in the URDF");
  }
  if (!has_position(joints_[*followed].type)) {
    throw ModelError(title(joint.name) + " mimics " + title(mimic.joint) +
                     ", which has no position: it is fixed, planar or floating");
  }
  return *followed;
}

std::optional<std::size_t> Kinematics::find_body(const std::string& name) const {
  const auto found = body_of_name_.find(name);
  if (found == body_of_name_.end()) return std::nullopt;
  return found->second;
}

std::optional<std::size_t> Kinematics::find_joint(const std::string& name) const {
  const auto found = joint_of_name_.find(name);
  if (found == joint_of_name_.end()) return std::nullopt;
  return found->second;
}

Eigen::Isometry3d Kinematics::joint_pose(std::size_t joint, double q) const {
  const Joint& at = joints_[joint];
  assert(!at.has_unstated_pose());
  Eigen::Isometry3d X_PC = at.X_PJ;
  if (at.type == JointType::kPrismatic) {
    X_PC.translate(q * at.axis);
  } else if (has_position(at.type)) {
    X_PC.rotate(Eigen::AngleAxisd(q, at.axis));
  }
  return X_PC;
}

/// The place at which a joint is stated, or else at which the nearest joint of its chain of mimics
/// that is stated puts it; NaN: none is.
double Kinematics::led_position(const std::vector<double>& q, std::size_t joint) const {
  double factor = 1.0, offset = 0.0;
  while (std::isnan(q[joint]) && joints_[joint].leader != joint) {
    offset += factor * joints_[joint].mimic.offset;
    factor *= joints_[joint].mimic.multiplier;
    joint = joints_[joint].leader;
  }
  return factor * q[joint] + offset;
}

void Kinematics::place_mimics(std::vector<double>* q) const {
  for (const std::size_t j : mimics_) (*q)[j] = led_position(*q, j);
}

void Kinematics::place_joints(const std::vector<double>& q, JointPoses* poses) const {
  poses->X_PC.resize(joints_.size(), Eigen::Isometry3d::Identity());
  poses->known.assign(joints_.size(), false);
  if (q.size() != joints_.size()) return;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Joint& joint = joints_[j];
    if (joint.has_unstated_pose()) continue;
    const double position = joint.type == JointType::kFixed ? 0.0 : led_position(q, j);
    if (!std::isfinite(position)) continue;
    if (joint.type == JointType::kPrismatic && std::abs(position) > kMaxLength) continue;
    poses->X_PC[j] = joint_pose(j, position);
    poses->known[j] = true;
  }
}

void Kinematics::place_bodies(const JointPoses& joints, const Eigen::Isometry3d& X_FR,
                              BodyPoses* poses) const {
  poses->X_FB.resize(bodies_.size(), Eigen::Isometry3d::Identity());
  poses->known.assign(bodies_.size(), false);
  if (joints.known.size() != joints_.size() || joints.X_PC.size() != joints_.size()) return;
  poses->X_FB[0] = X_FR;
  poses->known[0] = true;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const std::size_t parent = joints_[j].parent;
    if (!joints.known[j] || !poses->known[parent]) continue;
    poses->X_FB[j + 1] = poses->X_FB[parent] * joints.X_PC[j];
    poses->known[j + 1] = true;
  }
}

std::optional<std::size_t> Kinematics::first_unknown(const JointPoses& poses,
                                                     std::size_t body) const {
  std::optional<std::size_t> first;
  for (; body > 0; body = joints_[body - 1].parent) {
    if (body > poses.known.size() || !poses.known[body - 1]) first = body - 1;
  }
  return first;
}

}  // namespace ist
