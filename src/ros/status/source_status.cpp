#include <ist_proximity/ProximityArray.h>

#include <cmath>

#include "internal/cloud/unmeasured.h"
#include "ros/common/text.h"
#include "ros/status/status.h"

namespace ist {
namespace {

using ist_proximity::ProximityArray;

std::string seconds(double value) {
  return std::abs(value) < 100 ? format_text("%.2f s", value) : format_text("%.0f s", value);
}

Status no_cloud(const SourceReport& source, const std::string& text) {
  return {ProximityArray::NO_CLOUD, "source '" + source.name + "' on " + source.topic + text};
}
Status stale_cloud(const SourceReport& source, const std::string& text) {
  return {ProximityArray::STALE_CLOUD, no_cloud(source, text).text};
}

std::string allowed(const SourceReport& source) {
  return seconds(source.timeout) + " (~" + source.timeout_parameter + ")";
}

std::string because(const std::string& problem) {
  return problem.empty() ? std::string() : ": " + problem;
}

/// The status of a source without a topic, or whose topic is not the reason.
Status without_topic(const SourceReport& source, const std::string& text) {
  return {ProximityArray::NO_CLOUD, "source '" + source.name + "': " + text};
}

/// What is missing must not read as free.
Status incomplete(const SourceReport& source) { return without_topic(source, source.incomplete); }

Status without_messages(const SourceReport& source) {
  if (source.working > 1.0) {
    return no_cloud(source, ": the first " + source.noun + " has been read for " +
                                seconds(source.working) + " so far");
  }
  const std::string cause = source.publishers == 0
                                ? ", nobody publishes a " + source.type +
                                      " there; start the sensor's driver, or set or remap the topic"
                                : ", although there is a publisher";
  const std::string advice = source.advice.empty() ? "" : "; " + source.advice;
  return no_cloud(source, ": nothing received yet" + cause + advice);
}

/// The share of the timeout from which the time to read and ingest a message is why it is stale.
constexpr double kSlow = 0.5;

/// Names an ingest that is slower than the source's timeout allows; else empty.
std::string slow_ingest(const SourceReport& source) {
  const std::string advice =
      ": too long for its timeout; send smaller ones, lower max_range, switch the noise filter "
      "off, "
      "or raise ~" +
      source.timeout_parameter;
  if (source.working > kSlow * source.timeout) {
    return ": the last " + source.noun + " has been read and indexed for " +
           seconds(source.working) + " so far" + advice;
  }
  if (source.last_work > kSlow * source.timeout) {
    const std::string points =
        source.has_snapshot ? " (" + std::to_string(source.counts.received) + " points)" : "";
    return ": it takes " + seconds(source.last_work) + " to read and index a " + source.noun +
           points + advice;
  }
  return "";
}

/// The reason of a source that is stale: what was wrong with the last message, or its ingest.
std::string cause_of_staleness(const SourceReport& source) {
  const std::string slow = slow_ingest(source);
  const bool is_working = source.working > kSlow * source.timeout;
  return is_working || source.problem.empty() ? slow : because(source.problem);
}

/// The likely causes where no newer message has come.
std::string question(const SourceReport& source) {
  return source.noun == "map"
             ? "; is it latched, and sent once? Then its timeout should be .inf"
             : "; has its driver stopped, or do the clocks of sensor and node differ?";
}

Status stale(const SourceReport& source, double age) {
  const std::string cause = cause_of_staleness(source);
  return stale_cloud(source, ": the newest " + source.noun + " is " + seconds(age) +
                                 " old, allowed is " + allowed(source) +
                                 (cause.empty() ? question(source) : cause));
}

/// [s] Two instants of one message, its receipt and the beginning of its work, differ by less.
constexpr double kSameMessage = 0.01;

/// The snapshot in use is stale, though the newest message is not. A cloud that has just begun to
/// be read is the reason before it has taken long.
Status stale_snapshot(const SourceReport& source, double age) {
  std::string cause = cause_of_staleness(source);
  if (cause.empty() && source.working > 0.0) {
    cause = ": a newer one has been read and indexed for " + seconds(source.working) + " so far";
  } else if (cause.empty() && source.newest - source.counts_from.toSec() > kSameMessage) {
    cause = ": a newer one waits to be read";
  } else if (cause.empty()) {
    cause = question(source);
  }
  return stale_cloud(source, ": the last usable " + source.noun + " is " + seconds(age) +
                                 " old, allowed is " + allowed(source) + cause);
}

/// The prefix of the parameters of a source.
std::string prefix_of(const SourceReport& source) {
  return source.timeout_parameter == "cloud_timeout" ? "" : "sources/" + source.name + "/";
}

/// Whether the newest message, which is fresh, shows the sensor's view.
Status view_status(const SourceReport& source) {
  const IngestCounts& counts = source.counts;
  if (counts.saw_enough(source.min_measured)) return {ProximityArray::OK, ""};
  if (counts.not_a_number + counts.noise == counts.received) {
    return no_cloud(source, ": every point of the newest " + source.noun +
                                " is NaN, the sensor sees nothing at all");
  }
  const std::string question =
      counts.not_believed <= counts.received / 2
          ? "; is the sensor covered or blind?"
          : format_text(": more than %g m (or a larger ~", source.sensor_range) +
                prefix_of(source) +
                "max_range), or than range_max of a scan; are its lengths in metres?";
  return no_cloud(source,
                  format_text(": only %.1f %% of the newest ", 100.0 * counts.measured_share()) +
                      source.noun + " was measured, " +
                      format_text("at least %g %% are needed: of ", 100.0 * source.min_measured) +
                      std::to_string(counts.received) + " points " + unmeasured(counts) + question);
}

}  // namespace

Status source_status(const SourceReport& source, double now) {
  if (source.is_memory) return memory_status(source, {ProximityArray::OK, ""});
  if (!source.measures && !source.incomplete.empty()) return incomplete(source);
  if (source.is_file) {
    if (source.has_snapshot) return {ProximityArray::OK, ""};
    return without_topic(source,
                         source.problem.empty() ? "its file is being read" : source.problem);
  }
  if (source.messages == 0) return without_messages(source);
  if (std::isnan(source.newest)) {  // all stamps are 0 or far in the future
    return stale_cloud(source, because(source.problem));
  }
  if (!source.alternation.empty()) return stale_cloud(source, because(source.alternation));
  const double newest_age = now - source.newest;
  if (newest_age > source.timeout) return stale(source, newest_age);
  if (!source.has_snapshot) {
    return no_cloud(source,
                    ": no " + source.noun + " could be used yet" + cause_of_staleness(source));
  }
  const double age = now - source.counts_from.toSec();
  if (age > source.timeout) return stale_snapshot(source, age);
  if (now - source.same_since > source.frozen_after) {  // false for NaN
    return stale_cloud(source, ": all of its " + source.noun + "s have held the same bytes for " +
                                   seconds(now - source.same_since) + ", allowed is " +
                                   seconds(source.frozen_after) + " (~" + prefix_of(source) +
                                   "frozen_after): its driver repeats itself");
  }
  Status view = view_status(source);
  if (!view.ok()) return view;
  if (!source.incomplete.empty()) return incomplete(source);
  return {ProximityArray::OK, ""};
}

Status memory_status(const SourceReport& memory, const Status& parent) {
  if (!memory.has_snapshot) {
    return without_topic(memory,
                         memory.problem.empty() ? "nothing is remembered yet" : memory.problem);
  }
  if (parent.ok()) return parent;
  return {parent.code, without_topic(memory, "it is as fresh as its source: " + parent.text).text};
}

}  // namespace ist
