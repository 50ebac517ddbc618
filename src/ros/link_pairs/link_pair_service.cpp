#include "ros/link_pairs/link_pair_service.h"

#include <ros/console.h>

#include <algorithm>

#include "internal/proximity/pair_samples_cache.h"
#include "ist_proximity/proximity/collision_rules.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using PairMessage = ist_proximity::LinkPair;

// What was found of a pair; null: it was not sampled.
const SampledPair* find(const std::vector<SampledPair>& sampled, const LinkPair& pair) {
  const auto found = std::find_if(sampled.begin(), sampled.end(), [&](const SampledPair& one) {
    return one.pair.first == pair.first && one.pair.second == pair.second;
  });
  return found == sampled.end() ? nullptr : &*found;
}

std::uint8_t word_of(const SampledPair& pair) {
  if (pair.measured == 0) return PairMessage::NOT_KNOWN;
  if (pair.never()) return PairMessage::NEVER;
  return pair.always() ? PairMessage::ALWAYS : PairMessage::SOMETIMES;
}

// Says how many pairs were found to be what.
std::string text_of(const std::vector<SampledPair>& sampled, std::size_t configurations) {
  std::size_t counts[4] = {};
  for (const SampledPair& pair : sampled) ++counts[word_of(pair)];
  return "self-collision: in " + std::to_string(configurations) + " random configurations " +
         std::to_string(counts[PairMessage::NEVER]) + " pairs of links were never in contact, " +
         std::to_string(counts[PairMessage::ALWAYS]) + " always, " +
         std::to_string(counts[PairMessage::SOMETIMES]) + " sometimes (~link_pairs lists them)";
}

}  // namespace

LinkPairService::LinkPairService(const AddOnContext& node) : node_(node) {
  service_ = node_.private_nh.advertiseService("link_pairs", &LinkPairService::answer, this);
  thread_.start(
      "ist sampling", [this] { sample_newest(); }, true);
}

void LinkPairService::sample_newest() {
  if (model_ && !is_outdated(*model_)) return;
  model_ = node_.loader.state();
  const auto model = model_;
  if (!model->is_ready() || !model->kinematics) return;
  Findings findings;
  findings.model = model;
  findings.chosen = choose_pairs(model, [&] { return is_outdated(*model); }).all;
  findings.problem = "the pairs are being sampled";
  const auto show = [&] {
    std::atomic_store(&findings_, std::make_shared<const Findings>(findings));
  };
  show();
  sample(&findings);
  show();
}

/// Finer packings change nothing here.
bool LinkPairService::is_outdated(const ModelState& model) const {
  const auto newest = node_.loader.state();
  return !thread_.is_running() || (newest.get() != &model && !is_refinement(model, *newest));
}

void LinkPairService::sample(Findings* findings) {
  const ModelState& model = *findings->model;
  PairSampling sampling;
  findings->problem.clear();
  if (!model.objects.empty()) {
    findings->problem = "pairs are sampled without attached objects only";
    return;
  }
  std::vector<LinkPair> pairs;
  for (const ChosenPair& chosen : findings->chosen) {
    const bool is_sampled =
        chosen.reason != PairReason::kAdjacent && chosen.reason != PairReason::kUnusable;
    if (is_sampled) pairs.push_back(chosen.pair);
  }
  const PairSamplesCache cache(node_.config.model.cache_directory);
  const std::string key =
      pair_samples_key(*model.description, *model.robot, *model.kinematics, pairs, sampling);
  std::string warning;
  auto kept = cache.load(key, pairs, &warning);
  if (!kept) {
    findings->sampled = sample_pairs(model.robot, *model.kinematics, pairs, sampling,
                                     [&] { return is_outdated(model); });
    if (is_outdated(model)) return;
    cache.store(key, findings->sampled, &warning);
  } else {
    findings->sampled = std::move(*kept);
  }
  if (!warning.empty()) ROS_WARN_STREAM(warning);
  ROS_INFO_STREAM(text_of(findings->sampled, sampling.configurations));
  const std::string doubts = sampling_doubts(*model.kinematics);
  if (!doubts.empty()) ROS_WARN_STREAM("self-collision: " << doubts);
  const std::string apart = left_out_though_apart(*findings);
  if (apart.empty()) return;
  ROS_WARN_STREAM(
      "self-collision: in contact at rest (all joints at zero or at the limit next to it), and "
      "therefore not watched, but apart in other configurations: "
      << apart << "; enable_collisions of an SRDF watches them");
}

/// Names the pairs that are left out as in contact at rest, though they are often apart.
std::string LinkPairService::left_out_though_apart(const Findings& findings) {
  const RobotModel& robot = *findings.model->robot;
  std::vector<std::string> names;
  for (const ChosenPair& chosen : findings.chosen) {
    const SampledPair* sampled = find(findings.sampled, chosen.pair);
    if (chosen.reason != PairReason::kAtRest || !sampled) continue;
    if (sampled->contacts == sampled->measured) continue;
    names.push_back(robot.links[chosen.pair.first].name + " and " +
                    robot.links[chosen.pair.second].name + " (apart in " +
                    std::to_string(sampled->measured - sampled->contacts) + " of " +
                    std::to_string(sampled->measured) + ")");
  }
  return join(names, ", ");
}

bool LinkPairService::answer(Service::Request& request, Service::Response& response) {
  const std::shared_ptr<const Findings> findings = std::atomic_load(&findings_);
  if (!findings || is_outdated(*findings->model)) {
    const auto model = node_.loader.state();
    response.message = !model->is_ready()  ? model->problem
                       : model->kinematics ? "the pairs are being chosen"
                                           : no_kinematics(*model);
    return true;
  }
  response.success = true;
  response.message = findings->problem;
  const RobotModel& robot = *findings->model->robot;
  for (const ChosenPair& chosen : findings->chosen) {
    PairMessage pair;
    pair.first = robot.links[chosen.pair.first].name;
    pair.second = robot.links[chosen.pair.second].name;
    pair.reason = static_cast<std::uint8_t>(chosen.reason);
    if (const SampledPair* sampled = find(findings->sampled, chosen.pair)) {
      pair.sampled = word_of(*sampled);
      pair.contacts = static_cast<std::uint32_t>(sampled->contacts);
      pair.measured = static_cast<std::uint32_t>(sampled->measured);
    }
    response.pairs.push_back(pair);
  }
  if (!findings->sampled.empty()) {
    response.configurations = static_cast<std::uint32_t>(PairSampling().configurations);
  }
  response.srdf =
      to_srdf(robot, *findings->model->kinematics, findings->sampled, request.never != 0);
  return true;
}

}  // namespace ist
