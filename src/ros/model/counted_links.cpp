#include "ros/model/counted_links.h"

#include <algorithm>
#include <set>

#include "ist_proximity/robot/link_poses.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"

namespace ist {
namespace {

/// The sentence about names in ~ignore_links that are no links.
std::string unknown_ignored(const std::vector<std::string>& ignored,
                            const std::vector<std::string>& links) {
  const std::set<std::string> known(links.begin(), links.end());
  std::vector<std::string> sentences;
  for (const std::string& name : ignored) {
    if (known.count(name) > 0) continue;
    sentences.push_back("~ignore_links names " + quoted(name) + ", which is no monitored link" +
                        did_you_mean(name, known));
  }
  return join(sentences, "; ");
}

/// By monitored link: whether it may move in the fixed frame, as far as is known.
std::vector<bool> may_move(const ModelState& model, const ServerConfig& config,
                           bool root_stands_still) {
  std::vector<bool> result(model.monitored.size(), true);
  if (!model.kinematics) return result;
  const std::string frame = has_frame_outside(model, config) && root_stands_still
                                ? model.root_link
                                : without_slash(fixed_frame_of(model, config));
  const std::vector<bool> moves = links_that_move(*model.robot, *model.kinematics, frame);
  for (std::size_t k = 0; k < result.size(); ++k) result[k] = moves[model.monitored[k]];
  return result;
}

std::string explain(const std::vector<std::string>& ignored,
                    const std::vector<std::string>& fixed) {
  std::vector<std::string> parts;
  if (!fixed.empty()) {
    parts.push_back(join(fixed, ", ") +
                    ", which cannot move in the fixed frame (~min_distance/fixed_links)");
  }
  if (!ignored.empty()) parts.push_back(join(ignored, ", ") + " (~ignore_links)");
  return parts.empty() ? "" : "~min_distance and ~speed_scale leave out " + join(parts, ", and ");
}

}  // namespace

bool has_frame_outside(const ModelState& model, const ServerConfig& config) {
  return model.kinematics &&
         !model.kinematics->find_body(without_slash(fixed_frame_of(model, config)));
}

CountedLinks counted_links(const ModelState& model, const ServerConfig& config,
                           const std::vector<std::string>& ignored, bool root_stands_still) {
  CountedLinks result;
  result.links = model.links;
  result.counts.assign(model.links.size(), true);
  if (!model.robot || model.monitored.size() != model.links.size()) return result;
  std::set<std::string> ignore(config.ignore_links.begin(), config.ignore_links.end());
  ignore.insert(ignored.begin(), ignored.end());
  result.problem = unknown_ignored(config.ignore_links, model.links);

  const std::vector<bool> moves = may_move(model, config, root_stands_still);
  std::vector<std::string> left_out, fixed;
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const bool is_ignored = ignore.count(model.links[i]) > 0;
    result.counts[i] = !is_ignored && (moves[i] || config.fixed_links_count);
    if (is_ignored) left_out.push_back(quoted(model.links[i]));
    if (!is_ignored && !result.counts[i]) fixed.push_back(quoted(model.links[i]));
  }
  // A sensor on a post: nothing can move, and its distances are asked for all the same.
  const bool none_left =
      std::none_of(result.counts.begin(), result.counts.end(), [](bool counts) { return counts; });
  if (none_left && !fixed.empty()) {
    for (std::size_t i = 0; i < model.links.size(); ++i) {
      result.counts[i] = ignore.count(model.links[i]) == 0;
    }
    fixed.clear();
  }
  result.explanation = explain(left_out, fixed);
  return result;
}

}  // namespace ist
