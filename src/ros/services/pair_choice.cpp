#include "ros/services/pair_choice.h"

#include <algorithm>
#include <tuple>

#include "ist_proximity/proximity/collision_rules.h"
#include "ros/common/text.h"

namespace ist {
namespace {

constexpr int kCoarse = 64;  // spheres of a link's packing

/// @param pairs  sorted
bool holds(const std::vector<LinkPair>& pairs, const LinkPair& pair) {
  return std::binary_search(
      pairs.begin(), pairs.end(), pair, [](const LinkPair& one, const LinkPair& other) {
        return std::tie(one.first, one.second) < std::tie(other.first, other.second);
      });
}

/// The robot without what its links carry, its links in the same places. Queries are exact with any
/// packing, so that of a link that carries something is coarse.
/// @returns null when cancelled
std::shared_ptr<const RobotModel> without_objects(const ModelState& model,
                                                  const std::function<bool()>& cancelled) {
  if (model.objects.empty()) return model.robot;
  RobotModelConfig config;
  config.packing.max_spheres = kCoarse;
  for (const AttachedObject& object : model.objects) config.links.push_back(object.link);
  RobotModelCallbacks callbacks;
  callbacks.cancelled = cancelled;
  const auto bare = build_robot_model(*model.description, config, callbacks);
  if (!bare) return nullptr;
  auto robot = std::make_shared<RobotModel>(*model.robot);
  for (LinkModel& link : robot->links) {
    for (const LinkModel& own : bare->links) {
      if (own.name == link.name) link = own;
    }
  }
  return robot;
}

/// The pairs that touch with all joints at zero, always or nearly so. What a link carries does not
/// count: a pair that a tool touches at zero is apart elsewhere, and has to be watched.
std::vector<LinkPair> touching_at_rest(const ModelState& model, std::vector<LinkPair> pairs,
                                       const std::function<bool()>& cancelled) {
  const auto robot = without_objects(model, cancelled);
  if (!robot) return {};
  const auto is_unusable = [&robot](const LinkPair& pair) {
    return !robot->links[pair.first].usable() || !robot->links[pair.second].usable();
  };
  pairs.erase(std::remove_if(pairs.begin(), pairs.end(), is_unusable), pairs.end());
  return in_contact_at_rest(robot, *model.kinematics, pairs, cancelled);
}

}  // namespace

std::vector<LinkPair> PairChoice::watched() const {
  std::vector<LinkPair> pairs;
  for (const ChosenPair& chosen : all) {
    if (chosen.reason == PairReason::kWatched) pairs.push_back(chosen.pair);
  }
  return pairs;
}

std::string PairChoice::text(const RobotModel& robot) const {
  const auto count = [&](PairReason reason) {
    return std::to_string(std::count_if(
        all.begin(), all.end(), [&](const ChosenPair& chosen) { return chosen.reason == reason; }));
  };
  std::vector<std::string> at_rest;
  for (const ChosenPair& chosen : all) {
    if (chosen.reason != PairReason::kAtRest) continue;
    at_rest.push_back(robot.links[chosen.pair.first].name + " and " +
                      robot.links[chosen.pair.second].name);
  }
  return "self-collision: " + count(PairReason::kWatched) +
         " pairs of links are watched; left out: " + count(PairReason::kAdjacent) + " adjacent, " +
         count(PairReason::kSrdf) + " by the SRDF, " + count(PairReason::kUnusable) +
         " of unusable geometry, " + count(PairReason::kAtRest) + " in contact at rest" +
         (at_rest.empty() ? "" : ": ") + join(at_rest, ", ");
}

PairChoice choose_pairs(const std::shared_ptr<const ModelState>& monitoring,
                        const std::function<bool()>& cancelled) {
  const auto with_hulls = with_paired(monitoring);
  const ModelState& model = *with_hulls;
  PairChoice choice;
  const RobotModel& robot = *model.robot;
  const CollisionRules& rules = *model.rules;
  CollisionRules only_enabled;  // which may be of adjacent links
  only_enabled.enabled = rules.enabled;
  const std::vector<bool> wanted = wanted_links(model);
  const auto pairs_by = [&](const CollisionRules& by) {
    return self_collision_pairs(robot, *model.kinematics, wanted, {}, by);
  };
  const std::vector<LinkPair> candidates = pairs_by(only_enabled), left = pairs_by(rules);
  const std::vector<LinkPair> at_rest = touching_at_rest(model, left, cancelled);
  const auto reason_of = [&](const LinkPair& pair) {
    if (!wanted[pair.first] || !wanted[pair.second]) return PairReason::kUnusable;
    if (!holds(candidates, pair)) return PairReason::kAdjacent;
    if (!holds(left, pair)) return PairReason::kSrdf;
    const bool is_stated =
        rules.enables(robot.links[pair.first].name, robot.links[pair.second].name);
    return holds(at_rest, pair) && !is_stated ? PairReason::kAtRest : PairReason::kWatched;
  };
  std::vector<std::size_t> links = model.monitored;
  std::sort(links.begin(), links.end());
  for (std::size_t i = 0; i < links.size(); ++i) {
    for (std::size_t k = i + 1; k < links.size(); ++k) {
      const LinkPair pair{links[i], links[k]};
      choice.all.push_back({pair, reason_of(pair)});
    }
  }
  return choice;
}

}  // namespace ist
