#include "ist_proximity/proximity/self_query.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <random>
#include <set>
#include <string_view>
#include <utility>

#include "ist_proximity/geometry/error.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {
namespace {

/// By body: what decides whether two bodies with geometry are rigidly connected, or adjacent (one
/// is an ancestor of the other, with no body that has geometry between them).
struct Neighbours {
  Neighbours(const Kinematics& kinematics, const std::vector<bool>& has_geometry)
      : rigid_group(has_geometry.size(), 0), ancestor(has_geometry.size(), 0) {
    for (const Kinematics::Joint& joint : kinematics.joints()) {  // a parent comes before its child
      const bool is_fixed = joint.type == JointType::kFixed;
      rigid_group[joint.child] = is_fixed ? rigid_group[joint.parent] : joint.child;
      ancestor[joint.child] = has_geometry[joint.parent] ? joint.parent : ancestor[joint.parent];
    }
  }

  bool never_collide(std::size_t a, std::size_t b) const {
    const auto [above, below] = std::minmax(a, b);  // a body's number is above its parent's
    return rigid_group[a] == rigid_group[b] || ancestor[below] == above;
  }

  std::vector<std::size_t> rigid_group;  ///< the body nearest to the root that fixed joints lead to
  std::vector<std::size_t> ancestor;  ///< the nearest with geometry; the root where there is none
};

// Pairs of names in any order. An SRDF may hold hundreds of thousands.
class NamePairSet {
 public:
  explicit NamePairSet(const NamePairs& pairs) {
    for (const auto& pair : pairs) pairs_.insert(std::minmax(pair.first, pair.second));
  }
  bool holds(const std::string& a, const std::string& b) const {
    return pairs_.count(std::minmax(a, b)) > 0;
  }

 private:
  std::set<std::pair<std::string_view, std::string_view>>
      pairs_;  // of the names that it is made of
};

// A planar or floating joint has no rest position, so the bodies below it are a group of their own.
// Places such joints anywhere. @returns by body: its group
std::vector<std::size_t> rest_unstated_joints(const Kinematics& kinematics, JointPoses* poses) {
  const auto& joints = kinematics.joints();
  std::vector<std::size_t> group_of_body = {0};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    const bool starts_group = joints[j].has_unstated_pose();
    group_of_body.push_back(starts_group ? j + 1 : group_of_body[joints[j].parent]);
    if (!starts_group) continue;
    poses->X_PC[j] = joints[j].X_PJ;
    poses->known[j] = true;
  }
  return group_of_body;
}

// An XML attribute's value.
std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '"') {
      result += "&quot;";
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace

std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored) {
  std::vector<std::optional<std::size_t>> body_of_link;
  std::vector<bool> has_geometry(kinematics.bodies().size(), false);
  for (const LinkModel& link : model.links) {
    body_of_link.push_back(kinematics.find_body(link.name));
    if (body_of_link.back()) has_geometry[*body_of_link.back()] = true;
  }
  const Neighbours neighbours(kinematics, has_geometry);
  const NamePairSet ignored_names(ignored);
  const auto usable = [&](std::size_t i) {
    return wanted[i] && model.links[i].usable() && body_of_link[i].has_value();
  };
  std::vector<LinkPair> pairs;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    for (std::size_t k = i + 1; usable(i) && k < model.links.size(); ++k) {
      if (!usable(k) || neighbours.never_collide(*body_of_link[i], *body_of_link[k]) ||
          ignored_names.holds(model.links[i].name, model.links[k].name)) {
        continue;
      }
      pairs.push_back({i, k});
    }
  }
  return pairs;
}

std::vector<LinkPair> in_contact_at_rest(const std::shared_ptr<const RobotModel>& model,
                                         const Kinematics& kinematics,
                                         const std::vector<LinkPair>& pairs,
                                         const std::function<bool()>& cancelled) {
  const auto& joints = kinematics.joints();
  std::vector<double> q;
  q.reserve(joints.size());
  for (const auto& joint : joints) {
    q.push_back(joint.is_free() ? std::clamp(0.0, joint.lower, joint.upper) : std::nan(""));
  }
  JointPoses poses;
  kinematics.place_joints(q, &poses);
  const std::vector<std::size_t> group_of_body = rest_unstated_joints(kinematics, &poses);
  // The kinematics outlives this call, so the pointer does not own it.
  ForwardKinematics forward(*model, {std::shared_ptr<const Kinematics>(), &kinematics});
  const LinkPoses& links = forward.run(poses);
  const auto group = [&](std::size_t link) {
    return forward.body(link) ? group_of_body[*forward.body(link)] : 0;
  };
  QueryConfig config;
  config.max_distance = 0.01;  // [m] nothing but contact matters
  SelfQuery query(model, pairs, config, cancelled);
  std::vector<PairProximity> results;
  query.run(links.X_FL, links.known, &results);
  std::vector<LinkPair> found;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const bool have_rest = group(pairs[i].first) == group(pairs[i].second);
    if (have_rest && results[i].state == LinkState::kContact) found.push_back(pairs[i]);
  }
  return found;
}

std::vector<SampledPair> sample_pairs(const std::shared_ptr<const RobotModel>& model,
                                      const Kinematics& kinematics,
                                      const std::vector<LinkPair>& pairs,
                                      const PairSampling& sampling,
                                      const std::function<bool()>& cancelled) {
  constexpr double kTurn = 3.14159265358979323846, kSlide = 0.5;  // [rad, m] without limits
  const auto& joints = kinematics.joints();
  std::vector<SampledPair> sampled;
  sampled.reserve(pairs.size());
  for (const LinkPair& pair : pairs) sampled.push_back({pair, 0, 0});
  ForwardKinematics forward(*model, {std::shared_ptr<const Kinematics>(), &kinematics});
  QueryConfig config;
  config.max_distance = 0.001;  // [m] nothing but contact matters
  SelfQuery query(model, pairs, config);
  std::vector<PairProximity> results;
  std::mt19937_64 random(sampling.seed);
  std::vector<double> q(joints.size(), 0.0);
  JointPoses poses;
  for (std::size_t i = 0; i < sampling.configurations && !(cancelled && cancelled()); ++i) {
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const double free_range = joints[j].type == JointType::kPrismatic ? kSlide : kTurn;
      const double low = std::isfinite(joints[j].lower) ? joints[j].lower : -free_range;
      const double high = std::isfinite(joints[j].upper) ? joints[j].upper : free_range;
      // Not std::uniform_real_distribution, which differs between libraries.
      const double drawn = low + (high - low) * static_cast<double>(random() >> 11) * 0x1p-53;
      q[j] = joints[j].is_free() ? drawn : std::nan("");  // mimics follow
    }
    kinematics.place_joints(q, &poses);
    const std::vector<std::size_t> group_of_body = rest_unstated_joints(kinematics, &poses);
    const LinkPoses& links = forward.run(poses);
    query.run(links.X_FL, links.known, &results);
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const auto first = forward.body(pairs[k].first), second = forward.body(pairs[k].second);
      const bool have_pose = first && second && group_of_body[*first] == group_of_body[*second];
      if (!have_pose || results[k].state == LinkState::kUnknown) continue;
      ++sampled[k].measured;
      sampled[k].contacts += results[k].lower_bound <= 0.0 ? 1 : 0;
    }
  }
  return sampled;
}

std::string to_srdf(const RobotModel& model, const Kinematics& kinematics,
                    const std::vector<SampledPair>& sampled, bool never) {
  std::string srdf = "<?xml version=\"1.0\"?>\n<robot name=\"" + escaped(model.name) + "\">\n";
  const auto add = [&](const LinkPair& pair, const char* reason) {
    srdf += "  <disable_collisions link1=\"" + escaped(model.links[pair.first].name) +
            "\" link2=\"" + escaped(model.links[pair.second].name) + "\" reason=\"" + reason +
            "\"/>\n";
  };
  const std::vector<bool> all(model.links.size(), true);
  const std::vector<LinkPair> watched = self_collision_pairs(model, kinematics, all, {});
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    for (std::size_t k = i + 1; k < model.links.size(); ++k) {
      const bool is_watched =
          std::any_of(watched.begin(), watched.end(),
                      [&](const LinkPair& pair) { return pair.first == i && pair.second == k; });
      if (!is_watched && model.links[i].usable() && model.links[k].usable()) {
        add({i, k}, "Adjacent");
      }
    }
  }
  for (const SampledPair& pair : sampled) {
    if (pair.always()) add(pair.pair, "Always");
    if (pair.never() && never) add(pair.pair, "Never");
  }
  return srdf + "</robot>\n";
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
