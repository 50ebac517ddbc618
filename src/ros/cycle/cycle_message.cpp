#include "ros/cycle/cycle_message.h"

#include <cstddef>

#include "internal/robot/anytime_model.h"
#include "ros/common/ros_time.h"
#include "ros/common/text.h"
#include "ros/output/message_conversion.h"

namespace ist {

using ist_proximity::ProximityArray;

namespace {

/// The end of a sentence: poses that are older than a cloud are why it has none at its stamp.
std::string older_than_cloud(const StampedLinkPoses& poses, const PoseSource* source,
                             const SourceSnapshot& snapshot) {
  const double older = seconds_between(poses.stamp, snapshot.stamp);
  if (older <= 0.0) return "";
  return format_text("; the newest poses are %.2f s older than that cloud", older) +
         (source ? ": " + source->hint() : "");
}

/// Describes the links whose geometry cannot be used: a sentence each, or where there are many the
/// first ones' and one that names the others. A link that is pending is none of them.
std::vector<std::string> faulty_links(const RobotModel& robot,
                                      const std::vector<std::size_t>& monitored) {
  constexpr std::size_t kFew = 6, kTold = 3;
  std::vector<std::string> reasons, names;
  for (const std::size_t i : monitored) {
    const LinkModel& link = robot.links[i];
    if (link.usable() || is_pending(link)) continue;
    reasons.push_back(link.error);
    names.push_back(quoted(link.name));
  }
  if (reasons.size() <= kFew) return reasons;
  reasons.resize(kTold);
  names.erase(names.begin(), names.begin() + kTold);
  reasons.push_back("nor can the geometry of " + join(names, ", ") +
                    " be used: the diagnostics of the model give the reasons");
  return reasons;
}

}  // namespace

void fill_status(const StatusInput& input, const Status& status, ProximityArray* message) {
  message->sources.resize(input.sources.size());
  for (std::size_t i = 0; i < input.sources.size(); ++i) {
    assign_source(input.sources[i], message->header.stamp, &message->sources[i]);
  }
  message->status = status.code;
  message->status_text = status.text;
}

void fill_without_model(const ModelState& model, const ServerConfig& config, const ros::Time& now,
                        const CloudSources& sources, ProximityArray* message, CycleReport* report) {
  StatusInput input;
  input.findings = model_findings(model);
  input.has_model = model.problem.empty();
  input.clock_runs = !now.isZero();
  for (const auto& source : sources) {
    input.sources.emplace_back();
    source->report(&input.sources.back());
    input.sources.back().status = source_status(input.sources.back(), now.toSec());
  }
  *message = ProximityArray();
  message->header.stamp = now;
  message->header.frame_id = fixed_frame_of(model, config);
  for (const std::string& link : model.links) message->links.push_back(unknown_link(link));
  const Findings findings = find_all(input, now.toSec());
  const Status status = decide(findings, input.clock_runs);
  fill_status(input, status, message);
  report->take(input, findings, status);
  report->links_monitored = model.links.size();
  report->links_known = 0;
}

Findings model_findings(const ModelState& model) {
  Findings findings;
  note(model.is_loading() ? Rank::kLoading : Rank::kModel, "model", model.problem, &findings);
  if (model.robot) {
    note(Rank::kModel, "model", faulty_links(*model.robot, model.monitored), &findings);
  }
  return findings;
}

std::vector<std::string> missing_poses(const RobotModel& robot,
                                       const std::vector<std::size_t>& monitored,
                                       const StampedLinkPoses& poses, const PoseSource* source) {
  std::vector<std::string> sentences, others;
  for (const std::size_t i : monitored) {
    if (poses.problems[i].empty()) continue;
    const std::string name = quoted(robot.links[i].name);
    if (sentences.empty()) {
      const bool needs_hint = source && !poses.problems[i].explained;
      sentences.push_back("link " + name + " has no pose: " + poses.problems[i].text +
                          (needs_hint ? "; " + source->hint() : ""));
    } else {
      others.push_back(name);
    }
  }
  if (!others.empty()) sentences.push_back("no pose either for " + join(others, ", "));
  return sentences;
}

std::string unfiltered_links(const RobotModel& robot, const std::vector<std::size_t>& monitored,
                             const StampedLinkPoses& poses, const PoseSource* pose_source,
                             const SourceSnapshot& snapshot, const std::string& source) {
  if (snapshot.filtered.empty()) return "";
  std::vector<std::string> unfiltered;
  for (const std::size_t i : monitored) {
    if (poses.known[i] && !snapshot.filtered[i]) unfiltered.push_back(quoted(robot.links[i].name));
  }
  if (unfiltered.empty()) return "";
  return "no pose at the stamp of the cloud in use from source '" + source +
         "', so that its own points are still in it: " + join(unfiltered, ", ") +
         older_than_cloud(poses, pose_source, snapshot);
}

}  // namespace ist
