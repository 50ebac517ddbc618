#include "ist_proximity/proximity/self_collision_pairs.h"

#include <tinyxml2.h>

#include <algorithm>
#include <optional>

#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

/// Joints between two links of the tree.
std::vector<std::size_t> path(const Kinematics& kinematics, std::size_t a, std::size_t b) {
  std::vector<std::size_t> joints;
  while (a != b) {  // a link's number is above its parent's
    std::size_t& deeper = a > b ? a : b;
    joints.push_back(deeper - 1);
    deeper = kinematics.joints()[deeper - 1].parent;
  }
  return joints;
}

bool never_collide(const Kinematics& kinematics, const std::vector<bool>& has_geometry,
                   std::size_t a, std::size_t b) {
  bool rigid = true, is_above = false;  // one carries the other, if only by links without geometry
  std::vector<std::size_t> between;
  for (const std::size_t j : path(kinematics, a, b)) {
    const Kinematics::Joint& joint = kinematics.joints()[j];
    rigid = rigid && joint.type == JointType::kFixed;
    is_above = is_above || joint.parent == std::min(a, b);
    between.push_back(joint.parent);
    between.push_back(joint.child);
  }
  const bool adjacent =
      is_above && std::none_of(between.begin(), between.end(), [&](std::size_t link) {
        return link != a && link != b && has_geometry[link];
      });
  return rigid || adjacent;
}

bool names(const NamePairs& pairs, const std::string& a, const std::string& b) {
  return std::any_of(pairs.begin(), pairs.end(), [&](const auto& pair) {
    return (pair.first == a && pair.second == b) || (pair.first == b && pair.second == a);
  });
}

}  // namespace

std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored) {
  std::vector<std::optional<std::size_t>> place;
  std::vector<bool> has_geometry(kinematics.links().size(), false);
  for (const LinkModel& link : model.links) {
    place.push_back(kinematics.find_link(link.name));
    if (place.back()) has_geometry[*place.back()] = true;
  }
  const auto usable = [&](std::size_t i) {
    return wanted[i] && model.links[i].usable() && place[i].has_value();
  };
  std::vector<LinkPair> pairs;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    for (std::size_t k = i + 1; usable(i) && k < model.links.size(); ++k) {
      if (!usable(k) || never_collide(kinematics, has_geometry, *place[i], *place[k]) ||
          names(ignored, model.links[i].name, model.links[k].name)) {
        continue;
      }
      pairs.push_back({i, k});
    }
  }
  return pairs;
}

std::vector<LinkPair> in_contact_at_rest(const std::shared_ptr<const RobotModel>& model,
                                         const Kinematics& kinematics,
                                         const std::vector<LinkPair>& pairs) {
  const auto& joints = kinematics.joints();
  std::vector<double> q;
  q.reserve(joints.size());
  for (const auto& joint : joints) q.push_back(std::clamp(0.0, joint.lower, joint.upper));
  JointPoses poses;
  kinematics.place_joints(q, &poses);
  // What a planar or floating joint carries is anywhere: a body of its own, without a rest.
  std::vector<std::size_t> body = {0};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    body.push_back(joints[j].has_unstated_pose() ? j + 1 : body[joints[j].parent]);
    if (!joints[j].has_unstated_pose()) continue;
    poses.X_PC[j] = joints[j].X_PJ;
    poses.known[j] = true;
  }
  std::vector<Eigen::Isometry3d> X_RL, X_FL;
  std::vector<std::size_t> body_of_link;
  std::vector<bool> known;
  kinematics.place_links(poses, Eigen::Isometry3d::Identity(), &X_RL, &known);
  known.assign(model->links.size(), false);
  for (std::size_t i = 0; i < model->links.size(); ++i) {
    const auto place = kinematics.find_link(model->links[i].name);
    X_FL.push_back(place ? X_RL[*place] : Eigen::Isometry3d::Identity());
    body_of_link.push_back(place ? body[*place] : 0);
    known[i] = place.has_value();
  }
  QueryConfig config;
  config.max_distance = 0.01;  // [m] nothing but contact matters
  SelfQuery query(model, pairs, config);
  std::vector<PairProximity> results;
  query.run(X_FL, known, &results);
  std::vector<LinkPair> found;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const bool is_rigid_at_rest = body_of_link[pairs[i].first] == body_of_link[pairs[i].second];
    if (is_rigid_at_rest && results[i].state == LinkState::kContact) found.push_back(pairs[i]);
  }
  return found;
}

NamePairs disabled_collisions(const std::string& srdf_xml) {
  tinyxml2::XMLDocument document;
  if (document.Parse(srdf_xml.c_str(), srdf_xml.size()) != tinyxml2::XML_SUCCESS) {
    throw ModelError(std::string("the SRDF is not well-formed XML: ") + document.ErrorStr());
  }
  const tinyxml2::XMLElement* robot = document.FirstChildElement("robot");
  if (robot == nullptr) throw ModelError("the SRDF has no <robot>");
  NamePairs pairs;
  for (const auto* element = robot->FirstChildElement("disable_collisions"); element != nullptr;
       element = element->NextSiblingElement("disable_collisions")) {
    const char *first = element->Attribute("link1"), *second = element->Attribute("link2");
    if (first == nullptr || second == nullptr) {
      throw ModelError("the SRDF has a <disable_collisions> without link1 or link2 (line " +
                       std::to_string(element->GetLineNum()) + ")");
    }
    pairs.emplace_back(first, second);
  }
  return pairs;
}

}  // namespace ist
