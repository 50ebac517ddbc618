#include "ist_proximity/proximity/self_query.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <set>
#include <string_view>
#include <utility>

#include "ist_proximity/proximity/collision_rules.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {
namespace {

/// By body: what decides whether two bodies with geometry are rigidly connected, or adjacent (one
/// is an ancestor of the other, with no body that has geometry between them).
struct Neighbours {
  explicit Neighbours(const Kinematics& kinematics)
      : rigid_group(kinematics.bodies().size(), 0), ancestor(kinematics.bodies().size(), kNone) {
    const std::vector<bool>& has_geometry = kinematics.has_geometry();
    for (const Kinematics::Joint& joint : kinematics.joints()) {  // a parent comes before its child
      const bool is_fixed = joint.type == JointType::kFixed;
      rigid_group[joint.child] = is_fixed ? rigid_group[joint.parent] : joint.child;
      ancestor[joint.child] = has_geometry[joint.parent] ? joint.parent : ancestor[joint.parent];
    }
  }

  bool never_move(std::size_t a, std::size_t b) const { return rigid_group[a] == rigid_group[b]; }
  bool never_collide(std::size_t a, std::size_t b) const {
    const auto [above, below] = std::minmax(a, b);  // a body's number is above its parent's
    return never_move(a, b) || ancestor[below] == above;
  }

  static constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();
  std::vector<std::size_t> rigid_group;  ///< the body nearest to the root that fixed joints lead to
  std::vector<std::size_t> ancestor;     ///< the nearest with geometry of its own
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

// A joint is drawn over all its positions, over one turn, or not at all.
enum class Drawing { kComplete, kOneTurn, kImpossible };

// A joint without limits that turns is back where it was after a turn, so a turn is all its
// positions. A slide has no such range, and neither has a joint that another one drives by a gear
// which needs several turns for one.
Drawing drawing_of(const Kinematics& kinematics, std::size_t j) {
  const Kinematics::Joint& joint = kinematics.joints()[j];
  if (joint.has_unstated_pose()) return Drawing::kImpossible;
  if (joint.type == JointType::kFixed) return Drawing::kComplete;
  const Kinematics::Joint& source = kinematics.joints()[joint.source];
  if (std::isfinite(source.lower) && std::isfinite(source.upper)) return Drawing::kComplete;
  if (source.type == JointType::kPrismatic || joint.type == JointType::kPrismatic ||
      std::abs(joint.multiplier) < 1.0) {
    return Drawing::kImpossible;
  }
  return source.type == JointType::kContinuous ? Drawing::kComplete : Drawing::kOneTurn;
}

// The bodies below joints whose positions cannot be stated are a group of their own. Places planar
// and floating ones anywhere.
// @param starts_group  by joint
// @returns by body: its group
std::vector<std::size_t> groups_of_bodies(const Kinematics& kinematics,
                                          const std::vector<bool>& starts_group,
                                          JointPoses* poses) {
  const auto& joints = kinematics.joints();
  std::vector<std::size_t> group_of_body = {0};
  for (std::size_t j = 0; j < joints.size(); ++j) {
    group_of_body.push_back(starts_group[j] ? j + 1 : group_of_body[joints[j].parent]);
    if (!joints[j].has_unstated_pose()) continue;
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
                                           const NamePairs& ignored, const CollisionRules& rules) {
  std::vector<std::optional<std::size_t>> body_of_link;
  for (const LinkModel& link : model.links) {
    body_of_link.push_back(kinematics.find_body(link.name));
  }
  const Neighbours neighbours(kinematics);
  const NamePairSet ignored_names(ignored);
  const auto usable = [&](std::size_t i) {
    return wanted[i] && model.links[i].usable() && body_of_link[i].has_value();
  };
  std::vector<LinkPair> pairs;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    for (std::size_t k = i + 1; usable(i) && k < model.links.size(); ++k) {
      if (!usable(k)) continue;
      const std::string &first = model.links[i].name, &second = model.links[k].name;
      const bool is_left_out = rules.enables(first, second)
                                   ? neighbours.never_move(*body_of_link[i], *body_of_link[k])
                                   : neighbours.never_collide(*body_of_link[i], *body_of_link[k]);
      if (is_left_out || ignored_names.holds(first, second) || rules.disables(first, second)) {
        continue;
      }
      pairs.push_back({i, k});
    }
  }
  return pairs;
}

std::vector<LinkPair> self_collision_pairs(const RobotModel& model, const Kinematics& kinematics,
                                           const std::vector<bool>& wanted,
                                           const NamePairs& ignored) {
  return self_collision_pairs(model, kinematics, wanted, ignored, {});
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
  std::vector<bool> has_no_rest;
  has_no_rest.reserve(joints.size());
  for (const auto& joint : joints) has_no_rest.push_back(joint.has_unstated_pose());
  const std::vector<std::size_t> group_of_body = groups_of_bodies(kinematics, has_no_rest, &poses);
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

namespace {

/// A position within a joint's limits, or within a turn; NaN for a mimic joint, which follows.
double draw(const Kinematics::Joint& joint, std::mt19937_64* random) {
  constexpr double kHalfTurn = 3.14159265358979323846;  // [rad]
  const bool has_limits = std::isfinite(joint.lower) && std::isfinite(joint.upper);
  const double low = has_limits ? joint.lower : -kHalfTurn;
  const double high = has_limits ? joint.upper : kHalfTurn;
  // Not std::uniform_real_distribution, which differs between libraries.
  const double drawn = low + (high - low) * static_cast<double>((*random)() >> 11) * 0x1p-53;
  return joint.is_free() ? drawn : std::nan("");
}

}  // namespace

std::vector<SampledPair> sample_pairs(const std::shared_ptr<const RobotModel>& model,
                                      const Kinematics& kinematics,
                                      const std::vector<LinkPair>& pairs,
                                      const PairSampling& sampling,
                                      const std::function<bool()>& cancelled) {
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
  std::vector<bool> is_not_drawn;
  for (std::size_t j = 0; j < joints.size(); ++j) {
    is_not_drawn.push_back(drawing_of(kinematics, j) == Drawing::kImpossible);
  }
  JointPoses poses;
  for (std::size_t i = 0; i < sampling.configurations && !(cancelled && cancelled()); ++i) {
    for (std::size_t j = 0; j < joints.size(); ++j) q[j] = draw(joints[j], &random);
    kinematics.place_joints(q, &poses);
    const std::vector<std::size_t> group_of_body =
        groups_of_bodies(kinematics, is_not_drawn, &poses);
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

std::string sampling_doubts(const Kinematics& kinematics) {
  std::string turned, not_drawn;
  for (std::size_t j = 0; j < kinematics.joints().size(); ++j) {
    const Drawing drawing = drawing_of(kinematics, j);
    std::string* names = drawing == Drawing::kOneTurn      ? &turned
                         : drawing == Drawing::kImpossible ? &not_drawn
                                                           : nullptr;
    if (names == nullptr) continue;
    *names += (names->empty() ? "'" : ", '") + kinematics.joints()[j].name + "'";
  }
  if (!turned.empty()) turned = "joints without limits are drawn from -pi to pi: " + turned;
  if (!not_drawn.empty()) {
    not_drawn =
        "joints that have no limits and are not drawn over a turn cannot be sampled, nor the pairs "
        "of links that they move relative to each other: " +
        not_drawn + "; state their limits in the URDF";
  }
  return turned + (turned.empty() || not_drawn.empty() ? "" : "; ") + not_drawn;
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

}  // namespace ist
