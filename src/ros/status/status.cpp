#include "ros/status/status.h"

#include <ist_proximity/ProximityArray.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace ist {
namespace {

using ist_proximity::ProximityArray;

constexpr std::size_t kMaxSentences = 6;  // a status_text is to be read

std::string seconds(double value) {
  char text[32];
  std::snprintf(text, sizeof text, std::abs(value) < 100 ? "%.2f s" : "%.0f s", value);
  return text;
}

std::string title(const SourceFacts& source) {
  return "source '" + source.name + "' on " + source.topic;
}

std::string allowed(const SourceFacts& source) {
  return seconds(source.timeout) + " (~" + source.timeout_parameter + ")";
}

std::string because(const std::string& problem) {
  return problem.empty() ? std::string() : ": " + problem;
}

}  // namespace

double future_tolerance(double timeout) { return std::min(timeout, 1.0); }

Verdict judge_source(const SourceFacts& source, double now) {
  if (source.is_file) {
    if (source.has_snapshot) return {ProximityArray::OK, ""};
    return {ProximityArray::NO_CLOUD,
            "source '" + source.name + "'" +
                because(source.problem.empty() ? "its file is being read" : source.problem)};
  }
  if (source.messages == 0) {
    return {ProximityArray::NO_CLOUD,
            title(source) + ": nothing received yet" +
                (source.publishers == 0
                     ? ", nobody publishes a " + source.type +
                           " there; start the sensor's driver, or set or remap the topic"
                     : ", although there is a publisher")};
  }
  if (std::isnan(source.newest)) {  // nothing but stamps that are not of this time
    return {ProximityArray::STALE_CLOUD, title(source) + because(source.problem)};
  }
  const double newest_age = now - source.newest;
  if (newest_age > source.timeout) {
    return {ProximityArray::STALE_CLOUD,
            title(source) + ": the newest " + source.noun + " is " + seconds(newest_age) +
                " old, allowed is " + allowed(source) +
                (source.problem.empty() ? source.noun == "map"
                                              ? "; is it latched, and sent once? Then its timeout "
                                                "should be .inf"
                                              : "; has its driver stopped, or do the clocks of "
                                                "sensor and node differ?"
                                        : because(source.problem))};
  }
  if (!source.has_snapshot) {
    return {ProximityArray::NO_CLOUD,
            title(source) + ": no " + source.noun + " could be used yet" + because(source.problem)};
  }
  const double age = now - source.stamp.toSec();
  if (age > source.timeout) {
    return {ProximityArray::STALE_CLOUD, title(source) + ": the last usable " + source.noun +
                                             " is " + seconds(age) + " old, allowed is " +
                                             allowed(source) + because(source.problem)};
  }
  if (source.counts.saw_nothing()) {
    return {ProximityArray::NO_CLOUD, title(source) + ": every point of the newest " + source.noun +
                                          " is NaN, the sensor sees nothing at all"};
  }
  return {ProximityArray::OK, ""};
}

bool clouds_usable(const Situation& situation) {
  bool any = false;
  for (std::size_t i = 0; i < situation.sources.size(); ++i) {
    if (situation.verdicts[i].ok()) {
      any = true;
    } else if (situation.sources[i].required) {
      return false;
    }
  }
  return any;
}

Verdict judge(const Situation& situation, double now) {
  std::vector<Verdict> found;
  const auto add = [&found](std::uint8_t status, const std::string& text) {
    found.push_back({status, text});
  };

  if (!situation.model_problem.empty()) {
    add(ProximityArray::MODEL_ERROR, situation.model_problem);
  }
  for (const std::string& error : situation.link_errors) add(ProximityArray::MODEL_ERROR, error);

  // Where nothing is required, one of them is needed all the same.
  const auto& sources = situation.sources;
  const bool one_is_enough = std::none_of(
      sources.begin(), sources.end(), [](const SourceFacts& source) { return source.required; });
  const bool none_is_usable = std::none_of(situation.verdicts.begin(), situation.verdicts.end(),
                                           [](const Verdict& verdict) { return verdict.ok(); });
  const auto matters = [&](std::size_t i) {
    return !situation.verdicts[i].ok() &&
           (sources[i].required || (one_is_enough && none_is_usable));
  };
  const auto arrives_fresh = [&](const SourceFacts& source) {
    return source.is_file || (source.messages > 0 && now - source.newest <= source.timeout);
  };
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (matters(i) && sources[i].messages == 0 && !sources[i].is_file) {
      add(ProximityArray::NO_CLOUD, situation.verdicts[i].text);
    }
  }
  for (std::size_t i = 0; i < sources.size(); ++i) {
    if (matters(i) && sources[i].messages > 0 && !arrives_fresh(sources[i])) {
      add(ProximityArray::STALE_CLOUD, situation.verdicts[i].text);
    }
  }
  for (const std::string& problem : situation.pose_problems) {
    add(ProximityArray::NO_POSE, problem);
  }
  // Without a model no cloud can be used: that is no fault of the sources.
  for (std::size_t i = 0; i < sources.size() && situation.model_problem.empty(); ++i) {
    if (matters(i) && arrives_fresh(sources[i])) {
      add(situation.verdicts[i].status, situation.verdicts[i].text);
    }
  }
  if (situation.deadline_passed) {
    add(ProximityArray::DEGRADED,
        "~query/deadline passed before every link met ~query/tolerance: bounds hold but are wider; "
        "raise either, or ~packing/max_error");
  }
  if (situation.outside_region) {
    add(ProximityArray::DEGRADED,
        "a link is farther out than the limits of prismatic joints allow, and looks where points "
        "were "
        "dropped as out of reach: what it would have to know from there is not known; state these "
        "limits in the URDF as they are");
  }
  if (found.empty()) return {ProximityArray::OK, ""};

  Verdict verdict{found[0].status, ""};
  for (std::size_t i = 0; i < std::min(found.size(), kMaxSentences); ++i) {
    verdict.text += (i ? "; " : "") + found[i].text;
  }
  if (found.size() > kMaxSentences) {
    verdict.text += "; and " + std::to_string(found.size() - kMaxSentences) + " more";
  }
  if (!situation.clock_runs) {
    verdict.text = "/use_sim_time is set and nothing has come on /clock; " + verdict.text;
  }
  return verdict;
}

}  // namespace ist
