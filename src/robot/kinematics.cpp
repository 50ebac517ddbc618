#include "ist_proximity/robot/kinematics.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <map>
#include <set>
#include <string>

#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

bool has_position(JointType type) {
  return type == JointType::kRevolute || type == JointType::kContinuous ||
         type == JointType::kPrismatic;
}

std::string title(const std::string& joint) { return "joint '" + joint + "'"; }

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
  joint.source = index;
  joint.multiplier = 1.0;
  joint.offset = 0.0;
  return joint;
}

}  // namespace

bool Kinematics::Joint::is_free() const { return has_position(type) && source + 1 == child; }

Kinematics::Kinematics(const RobotDescription& description) {
  add_tree(description);
  resolve_mimics(description);
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
  assert(joints_.size() == description.joints.size() && "parse_urdf has checked that it is a tree");
}

void Kinematics::resolve_mimics(const RobotDescription& description) {
  std::map<std::string, const JointDescription*> by_name;
  for (const JointDescription& joint : description.joints) by_name[joint.name] = &joint;
  for (Joint& joint : joints_) {
    if (!has_position(joint.type)) continue;
    std::set<std::string> visited;
    const JointDescription* at = by_name.at(joint.name);
    while (at->mimic) {
      const Mimic& mimic = *at->mimic;
      if (!visited.insert(at->name).second) {
        throw ModelError(title(joint.name) + " follows joints that mimic one another in a ring");
      }
      if (!std::isfinite(mimic.multiplier) || !std::isfinite(mimic.offset)) {
        throw ModelError(title(at->name) + ": multiplier or offset of its <mimic> is not finite");
      }
      const auto next = by_name.find(mimic.joint);
      if (next == by_name.end()) {
        throw ModelError(title(at->name) + " mimics " + title(mimic.joint) +
                         ", which is not in the URDF");
      }
      if (!has_position(next->second->type)) {
        throw ModelError(title(at->name) + " mimics " + title(mimic.joint) +
                         ", which has no position: it is fixed, planar or floating");
      }
      joint.offset += joint.multiplier * mimic.offset;
      joint.multiplier *= mimic.multiplier;
      at = next->second;
    }
    joint.source = *find_joint(at->name);
  }
}

std::optional<std::size_t> Kinematics::find_body(const std::string& name) const {
  const auto found = std::find(bodies_.begin(), bodies_.end(), name);
  if (found == bodies_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - bodies_.begin());
}

std::optional<std::size_t> Kinematics::find_joint(const std::string& name) const {
  const auto found = std::find_if(joints_.begin(), joints_.end(),
                                  [&](const Joint& joint) { return joint.name == name; });
  if (found == joints_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - joints_.begin());
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

void Kinematics::place_joints(const std::vector<double>& q, JointPoses* poses) const {
  assert(q.size() == joints_.size());
  poses->X_PC.resize(joints_.size(), Eigen::Isometry3d::Identity());
  poses->known.assign(joints_.size(), false);
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Joint& joint = joints_[j];
    if (joint.has_unstated_pose()) continue;
    const bool fixed = joint.type == JointType::kFixed;
    const double position = fixed ? 0.0 : joint.multiplier * q[joint.source] + joint.offset;
    if (!std::isfinite(position)) continue;
    poses->X_PC[j] = joint_pose(j, position);
    poses->known[j] = true;
  }
}

void Kinematics::place_bodies(const JointPoses& joints, const Eigen::Isometry3d& X_FR,
                              BodyPoses* poses) const {
  poses->X_FB.resize(bodies_.size(), Eigen::Isometry3d::Identity());
  poses->known.assign(bodies_.size(), false);
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
    if (!poses.known[body - 1]) first = body - 1;
  }
  return first;
}

}  // namespace ist
