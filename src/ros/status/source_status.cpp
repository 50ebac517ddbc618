#include <ist_proximity/ProximityArray.h>

#include <algorithm>
#include <cmath>

#include "ros/common/text.h"
#include "ros/status/status.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

/// A message that takes more of its timeout to be taken in leaves too little for the next one.
constexpr double kSlowShare = 0.5;

std::string seconds(double value) {
  return std::abs(value) < 100 ? format_text("%.2f s", value) : format_text("%.0f s", value);
}

std::string title(const SourceReport& source) {
  return "source '" + source.name + "' on " + source.topic;
}

std::string allowed(const SourceReport& source) {
  return seconds(source.timeout) + " (~" + source.timeout_parameter + ")";
}

std::string because(const std::string& problem) {
  return problem.empty() ? std::string() : ": " + problem;
}

Status file_status(const SourceReport& source) {
  if (source.has_snapshot) return {ProximityArray::OK, ""};
  const std::string& problem = source.problem;
  return {ProximityArray::NO_CLOUD, "source '" + source.name + "': " +
                                        (problem.empty() ? "its file is being read" : problem)};
}

Status without_messages(const SourceReport& source) {
  const std::string cause = source.publishers == 0
                                ? ", nobody publishes a " + source.type +
                                      " there; start the sensor's driver, or set or remap the topic"
                                : ", although there is a publisher";
  return {ProximityArray::NO_CLOUD, title(source) + ": nothing received yet" + cause};
}

/// The cause where messages take longer to be taken in than they live; else empty.
std::string slow_ingest(const SourceReport& source) {
  const double taken = std::max(source.ingesting, source.has_snapshot ? source.ingest_time : 0.0);
  if (taken < kSlowShare * source.timeout) return "";
  return ": its messages come, and taking in one takes " + seconds(taken) +
         "; send smaller ones, lower max_range, switch noise_filter off, or raise ~" +
         source.timeout_parameter;
}

Status stale(const SourceReport& source, double age) {
  std::string cause = because(source.problem);
  if (cause.empty()) cause = slow_ingest(source);
  if (cause.empty() && source.noun == "map") {
    cause = "; is it latched, and sent once? Then its timeout should be .inf";
  } else if (cause.empty()) {
    cause = "; has its driver stopped, or do the clocks of sensor and node differ?";
  }
  return {ProximityArray::STALE_CLOUD, title(source) + ": the newest " + source.noun + " is " +
                                           seconds(age) + " old, allowed is " + allowed(source) +
                                           cause};
}

}  // namespace

Status source_status(const SourceReport& source, double now) {
  if (source.is_file) return file_status(source);
  if (source.messages == 0) return without_messages(source);
  if (std::isnan(source.newest)) {  // all stamps are 0 or far in the future
    return {ProximityArray::STALE_CLOUD, title(source) + because(source.problem)};
  }
  const double newest_age = now - source.newest;
  if (newest_age > source.timeout) return stale(source, newest_age);
  if (!source.has_snapshot) {
    return {ProximityArray::NO_CLOUD,
            title(source) + ": no " + source.noun + " could be used yet" +
                (source.problem.empty() ? slow_ingest(source) : because(source.problem))};
  }
  const double age = now - source.counts_from.toSec();
  if (age > source.timeout) {
    return {ProximityArray::STALE_CLOUD,
            title(source) + ": the last usable " + source.noun + " is " + seconds(age) +
                " old, allowed is " + allowed(source) +
                (source.problem.empty() ? slow_ingest(source) : because(source.problem))};
  }
  if (source.counts.saw_nothing()) {
    return {ProximityArray::NO_CLOUD, title(source) + ": every point of the newest " + source.noun +
                                          " is NaN, the sensor sees nothing at all"};
  }
  return {ProximityArray::OK, ""};
}

}  // namespace ist
