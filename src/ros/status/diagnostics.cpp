#include "ros/status/diagnostics.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace ist {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using ist_proximity::ProximityArray;

DiagnosticStatus make(const std::string& node, const std::string& what) {
  DiagnosticStatus status;
  status.name = node + ": " + what;
  status.hardware_id = node;
  status.level = DiagnosticStatus::OK;
  status.message = "OK";
  return status;
}

void set(std::uint8_t level, const std::string& message, DiagnosticStatus* status) {
  if (level <= static_cast<std::uint8_t>(status->level)) return;
  status->level = static_cast<decltype(status->level)>(level);
  status->message = message;
}

void add(const std::string& key, const std::string& value, DiagnosticStatus* status) {
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value = value;
  status->values.push_back(pair);
}

void add(const std::string& key, std::size_t value, DiagnosticStatus* status) {
  add(key, std::to_string(value), status);
}

std::string number(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

std::string milliseconds(double seconds) { return number("%.3f ms", 1e3 * seconds); }
std::string millimetres(double metres) { return number("%.2f mm", 1e3 * metres); }

/// A share of the cloud on the robot that speaks of a wrong transform or model; empty: none.
std::string doubt_of_self_filter(const SourceFacts& source) {
  constexpr double kNearlyAll = 0.95;
  const IngestCounts& counts = source.counts;
  if (!source.has_snapshot || std::isnan(source.blind_skin)) return "";
  const std::size_t in_range = counts.received - counts.not_a_number - counts.noise -
                               counts.infinite - counts.out_of_range - counts.outside_region;
  if (in_range == 0) return "";
  const double share = static_cast<double>(counts.on_robot) / static_cast<double>(in_range);
  if (share >= kNearlyAll) {
    return number("%.1f %% of the ", 100.0 * share) + source.noun +
           " are on the robot and filtered out: check the sensor's transform, the URDF and "
           "self_filter_padding";
  }
  // A laser scanner may well never see the robot.
  if (counts.on_robot == 0 && source.noun == "cloud") {
    return "no point of the cloud is on the robot: if the sensor sees the robot, its transform or "
           "the URDF is wrong; if it does not, self_filter: false says so";
  }
  return "";
}

// Why `penetration` is NaN in contact, where it is.
void add_contacts(const ModelState& state, const ContactModel* contacts, bool wanted,
                  DiagnosticStatus* status) {
  if (!wanted) {
    add("contact volumes", "off, ~penetration/enabled is false: penetration is NaN in contact",
        status);
    return;
  }
  if (!state.robot) return;
  const bool is_there = contacts != nullptr && contacts->robot == state.robot;
  std::size_t usable = 0, ready = 0;
  for (const std::size_t i : state.monitored) {
    if (!state.robot->links[i].usable()) continue;
    ++usable;
    if (!is_there || !contacts->links[i]) continue;
    ++ready;
    const ContactGeometry& body = *contacts->links[i];
    std::string text;
    if (body.has_volume()) {
      text = std::to_string(body.sphere_count) + number(" spheres, %.3f l", 1e3 * body.volume) +
             number(", filled to %.0f %%", 100.0 * body.packed_volume / body.volume) +
             (body.from_cache ? ", from the cache" : number(", packed in %.1f s", body.time));
    }
    if (!body.note.empty()) text += (text.empty() ? "" : "; ") + body.note;
    add("volume of " + state.robot->links[i].name, text, status);
  }
  add("contact volumes",
      ready == usable ? "ready"
                      : std::to_string(ready) + " of " + std::to_string(usable) +
                            " links; penetration is NaN in contact for those to come",
      status);
}

}  // namespace

void CycleTimes::add(double seconds) {
  if (ring_.size() < kKept) {
    ring_.push_back(seconds);
  } else {
    ring_[total_ % kKept] = seconds;
  }
  ++total_;
}

double CycleTimes::quantile(double q) const {
  if (ring_.empty()) return std::numeric_limits<double>::quiet_NaN();
  std::vector<double> sorted = ring_;
  std::sort(sorted.begin(), sorted.end());
  const auto rank = static_cast<std::size_t>(q * static_cast<double>(sorted.size()));
  return sorted[std::min(rank, sorted.size() - 1)];
}

DiagnosticStatus input_diagnostics(const std::string& node, const SourceFacts& source,
                                   const Verdict& verdict, double rate, double now) {
  DiagnosticStatus status = make(node, "input " + source.name);
  if (verdict.status == ProximityArray::STALE_CLOUD) {
    set(source.required ? DiagnosticStatus::STALE : DiagnosticStatus::WARN, verdict.text, &status);
  } else if (!verdict.ok()) {
    set(source.required ? DiagnosticStatus::ERROR : DiagnosticStatus::WARN, verdict.text, &status);
  } else if (!source.problem.empty()) {
    set(DiagnosticStatus::WARN, "the newest " + source.noun + " is not in use: " + source.problem,
        &status);
  }
  const std::string doubt = doubt_of_self_filter(source);
  if (!doubt.empty()) set(DiagnosticStatus::WARN, doubt, &status);
  add("topic", source.topic, &status);
  add("required", source.required ? "true" : "false", &status);
  add("publishers", source.publishers, &status);
  add("messages received", source.messages, &status);
  if (!source.is_file) add("rate", number("%.1f Hz", rate), &status);
  add("dropped: unusable", source.unusable, &status);
  add("dropped: out of order", source.out_of_order, &status);
  add("dropped: overtaken by a newer one", source.overtaken, &status);
  add("shown on ~filtered_cloud", source.shown, &status);
  if (!std::isnan(source.blind_skin)) {
    add("blind skin about the robot", millimetres(source.blind_skin), &status);
  }
  if (source.has_snapshot) {
    if (!source.is_file) add("age", number("%.3f s", now - source.stamp.toSec()), &status);
    add("points received", source.counts.received, &status);
    add("points used", source.counts.used, &status);
    add("points on the robot", source.counts.on_robot, &status);
    add("points out of range", source.counts.out_of_range, &status);
    add("points out of reach", source.counts.outside_region, &status);
    if (source.counts.noise > 0) add("points taken for noise", source.counts.noise, &status);
    add("points NaN", source.counts.not_a_number, &status);
    add("points infinite", source.counts.infinite, &status);
    add("time to ingest", milliseconds(source.ingest_time), &status);
  }
  return status;
}

DiagnosticStatus pose_diagnostics(const std::string& node, const CycleReport& report) {
  DiagnosticStatus status = make(node, "pose");
  if (!report.pose_problems.empty()) {
    set(DiagnosticStatus::ERROR, report.pose_problems.front(), &status);
  } else if (report.links_monitored == 0) {
    set(DiagnosticStatus::WARN, "no link is looked up yet", &status);
  }
  if (!report.transform_problem.empty()) {
    set(DiagnosticStatus::WARN, report.transform_problem, &status);
  }
  add("links monitored", report.links_monitored, &status);
  add("links with a pose", report.links_known, &status);
  if (report.links_known > 0) add("age", number("%.3f s", report.pose_age), &status);
  if (report.joint_states) {
    const JointStateFacts& joints = *report.joint_states;
    if (!joints.problem.empty()) set(DiagnosticStatus::WARN, joints.problem, &status);
    add("topic", joints.topic, &status);
    add("publishers", joints.publishers, &status);
    add("joint states received", joints.messages, &status);
    add("joint states used", joints.used, &status);
    add("joint states skipped: more came than can be answered", joints.skipped, &status);
    add("positions that cannot be used", joints.dropped, &status);
  }
  for (const std::string& problem : report.pose_problems) add("problem", problem, &status);
  return status;
}

DiagnosticStatus query_diagnostics(const std::string& node, const CycleReport& report, double rate,
                                   double wanted_rate) {
  DiagnosticStatus status = make(node, "query");
  if (report.status == ProximityArray::DEGRADED) {
    set(DiagnosticStatus::WARN, report.text, &status);
  } else if (report.status != ProximityArray::OK) {
    set(DiagnosticStatus::ERROR, report.text, &status);
  }
  const std::string wanted = report.joint_states ? "rate of the joint states" : "~rate";
  if (rate < 0.8 * wanted_rate) {
    set(DiagnosticStatus::WARN, "the rate is lower than " + wanted + ": the machine is too busy",
        &status);
  }
  add("rate", number("%.1f Hz", rate), &status);
  add(wanted, number("%.1f Hz", wanted_rate), &status);
  add("deadlines missed", report.deadlines_missed, &status);
  add("markers drawn", report.markers_drawn, &status);
  add("computation time, median", milliseconds(report.times.quantile(0.5)), &status);
  add("computation time, 99th percentile", milliseconds(report.times.quantile(0.99)), &status);
  return status;
}

DiagnosticStatus model_diagnostics(const std::string& node, const ModelState& state,
                                   const ContactModel* contacts, bool contacts_wanted) {
  DiagnosticStatus status = make(node, "model");
  const bool ready = state.phase == ModelState::Phase::kReady;
  if (!state.problem.empty()) {
    const bool under_way = state.phase == ModelState::Phase::kPacking;
    set(under_way ? DiagnosticStatus::WARN : DiagnosticStatus::ERROR, state.problem, &status);
  }
  add("ready", ready ? "100 %" : number("%.0f %%", 100 * state.fraction), &status);
  add("links monitored", state.links.size(), &status);
  for (const AttachedObject& object : state.objects) {
    add("attached object", "'" + object.name + "' on '" + object.link + "'", &status);
  }
  for (const std::size_t i : state.monitored) {
    const LinkModel& link = state.robot->links[i];
    if (!link.usable()) {
      set(DiagnosticStatus::ERROR, link.error, &status);
      add(link.name, link.error, &status);
      continue;
    }
    const PackingCertificate& certificate = link.packing.certificate;
    std::string text = std::to_string(link.packing.spheres.size()) + " spheres, largest gap " +
                       millimetres(certificate.max_gap) + ", mean " +
                       millimetres(certificate.mean_gap);
    if (certificate.unreachable_area > 0) {
      text += number(", %.1f cm2 of sheets", 1e4 * certificate.unreachable_area);
    }
    if (!certificate.reached) {
      text += ", ~packing/max_error not reached";
      set(DiagnosticStatus::WARN, "link '" + link.name + "': " + text, &status);
    }
    text += link.from_cache ? ", from the cache" : number(", packed in %.1f s", link.packing_time);
    add(link.name, text, &status);
  }
  add_contacts(state, contacts, contacts_wanted, &status);
  for (const std::string& warning : state.warnings) {
    set(DiagnosticStatus::WARN, warning, &status);
    add("warning", warning, &status);
  }
  return status;
}

}  // namespace ist
