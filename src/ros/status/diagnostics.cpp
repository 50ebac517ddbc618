#include "ros/status/diagnostics.h"

#include <array>
#include <cmath>

#include "ros/common/ros_time.h"
#include "ros/common/text.h"

namespace ist {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using ist_proximity::ProximityArray;

/// A sentence when the share of points on the robot suggests a wrong transform or model; else
/// empty.
std::string doubt_of_self_filter(const SourceReport& source) {
  constexpr double kNearlyAll = 0.95;
  const IngestCounts& counts = source.counts;
  if (!source.has_snapshot || std::isnan(source.blind_skin)) return "";
  const std::size_t in_range = counts.received - counts.not_a_number - counts.noise -
                               counts.infinite - counts.out_of_range - counts.outside_region;
  if (in_range == 0) return "";
  const double share = static_cast<double>(counts.on_robot) / static_cast<double>(in_range);
  if (share >= kNearlyAll) {
    return format_text("%.1f %% of the ", 100.0 * share) + source.noun +
           " are on the robot and filtered out: check the sensor's transform, the URDF and "
           "self_filter_padding";
  }
  // A laser scanner may never see the robot, so this concerns clouds only.
  if (counts.on_robot == 0 && (source.noun == "cloud" || source.noun == "image")) {
    return "no point of the " + source.noun +
           " is on the robot: if the sensor sees the robot, its transform or "
           "the URDF is wrong; if it does not, set self_filter: false";
  }
  return "";
}

void add_source_counts(const SourceReport& source, double rate, double now,
                       DiagnosticStatus* status) {
  add_value("topic", source.topic, status);
  add_value("required", source.required ? "true" : "false", status);
  if (source.is_memory) {
    if (source.has_snapshot) {
      add_value("age", format_text("%.3f s", now - source.counts_from.toSec()), status);
      add_value("boxes in use", source.counts.used, status);
      add_value("time to remember", milliseconds(source.ingest_time), status);
    }
    add_value("voxels occupied", source.memory_occupied, status);
    add_value("voxels in memory", source.memory_voxels, status);
    return;
  }
  add_value("publishers", source.publishers, status);
  add_value("messages received", source.messages, status);
  if (!source.is_file) add_value("rate", format_text("%.1f Hz", rate), status);
  if (source.ahead > 0.0) add_value("stamps ahead", milliseconds(source.ahead), status);
  add_value("dropped: unusable", source.unusable, status);
  add_value("dropped: out of order", source.out_of_order, status);
  add_value("new starts: stamps went back", source.restarts, status);
  add_value("dropped: overtaken by a newer one", source.overtaken, status);
  add_value("shown on ~filtered_cloud", source.shown, status);
  if (!std::isnan(source.blind_skin)) {
    add_value("blind skin about the robot", millimetres(source.blind_skin), status);
  }
  if (source.has_snapshot) {
    if (!source.is_file)
      add_value("age", format_text("%.3f s", now - source.counts_from.toSec()), status);
    add_value("points received", source.counts.received, status);
    add_value("points used", source.counts.used, status);
    add_value("points on the robot", source.counts.on_robot, status);
    add_value("points in zones", source.counts.in_zones, status);
    add_value("points out of range", source.counts.out_of_range, status);
    add_value("points outside the region of interest", source.counts.outside_region, status);
    if (source.counts.noise > 0) add_value("points taken for noise", source.counts.noise, status);
    add_value("points NaN", source.counts.not_a_number, status);
    add_value("points infinite", source.counts.infinite, status);
    add_value("points too near", source.counts.too_near, status);
    add_value("points not believed", source.counts.not_believed, status);
    add_value("identical points", source.counts.at_one_place, status);
    add_value("share measured", format_text("%.3f", source.counts.measured_share()), status);
    add_value("time to ingest", milliseconds(source.ingest_time), status);
    add_value("time of the first answer with it", milliseconds(source.warm_up_time), status);
    add_value("memory of the cloud's index",
              format_text("%.1f MB", 1e-6 * static_cast<double>(source.snapshot_memory)), status);
  }
}

/// Adds what the self-filter by view found.
void add_view(const SourceReport& source, DiagnosticStatus* status) {
  const bool is_used = source.has_snapshot && source.view.is_used;
  add_value("self-filter",
            !source.by_view ? "padding"
            : is_used       ? "view"
                            : "padding, not an image",
            status);
  if (!is_used) return;
  const ViewReport& view = source.view;
  add_value("correction of the sensor's pose on the robot", millimetres(view.offset), status);
  add_value("correction of the sensor's orientation",
            format_text("%.2f deg", view.angle * 180.0 / 3.14159265358979323846), status);
  add_value("uncertainty of the corrected pose", millimetres(view.uncertainty), status);
  add_value("residual of the robot's surface", millimetres(view.residual), status);
  for (std::size_t i = 0; i < view.links.size() && i < source.view_links.size(); ++i) {
    const LinkView& link = view.links[i];
    add_value("blind skin of " + source.view_links[i], millimetres(link.blind_skin), status);
    add_value("unexplained points in the skin of " + source.view_links[i], link.unexplained,
              status);
  }
}

/// Adds the deadline, and the worst that it has cost since the last diagnostics.
void add_deadline(const CycleReport& report, DiagnosticStatus* status) {
  const DeadlineCost& worst = report.worst_deadline;
  add_value("deadline", report.deadline > 0.0 ? milliseconds(report.deadline) : "none", status);
  add_value("deadlines missed", report.deadlines_missed, status);
  add_value("links unfinished, most of a cycle", worst.unfinished, status);
  add_value("widest bounds of unfinished links", millimetres(worst.widest), status);
  add_value("links with unblended repulsion, most of a cycle", worst.unblended, status);
  add_value("links without penetration, most of a cycle", worst.no_penetration, status);
}

void add_parts(const CycleReport& report, DiagnosticStatus* status) {
  const std::array<const char*, kCycleParts> names = {"poses",       "query",   "repulsion",
                                                      "penetration", "message", "publishing"};
  for (std::size_t i = 0; i < kCycleParts; ++i) {
    const std::string name = std::string("time of ") + names[i];
    add_value(name + ", median", milliseconds(report.parts[i].quantile(0.5)), status);
    add_value(name + ", 99th percentile", milliseconds(report.parts[i].quantile(0.99)), status);
  }
}

}  // namespace

using diagnostic_msgs::DiagnosticStatus;

DiagnosticStatus make_diagnostic(const std::string& node, const std::string& what,
                                 const Findings& findings) {
  DiagnosticStatus status;
  status.name = node + ": " + what;
  status.hardware_id = node;
  status.level = DiagnosticStatus::OK;
  status.message = "OK";
  const Finding* worst = nullptr;
  for (const Finding& finding : findings) {
    if (finding.what != what || (worst && finding.level <= worst->level)) continue;
    worst = &finding;
  }
  if (!worst) return status;
  status.level = static_cast<decltype(status.level)>(worst->level);
  status.message = worst->text;
  add_value("since", format_text("%.0f s", worst->since), &status);
  return status;
}

void add_value(const std::string& key, const std::string& value, DiagnosticStatus* status) {
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value = value;
  status->values.push_back(pair);
}

void add_value(const std::string& key, std::size_t value, DiagnosticStatus* status) {
  add_value(key, std::to_string(value), status);
}

std::string milliseconds(double seconds) { return format_text("%.3f ms", 1e3 * seconds); }
std::string millimetres(double metres) { return format_text("%.2f mm", 1e3 * metres); }

void add_remarks(double rate, double wanted_rate, CycleReport* report) {
  Findings* findings = &report->findings;
  for (std::size_t i = 0; i < report->sources.size(); ++i) {
    const SourceReport& source = report->sources[i];
    const std::string what = "input " + source.name;
    if (report->source_statuses[i].ok() && !source.problem.empty()) {
      note(Rank::kRemark, what, "the newest " + source.noun + " is not in use: " + source.problem,
           findings);
    }
    if (source.ahead >= kToldSkew) {
      note(Rank::kRemark, what,
           format_text("its stamps are %.3f s ahead of the clock", source.ahead) +
               ": its age counts from its receipt; compare the clocks of sensor and node",
           findings);
    }
    for (const std::string& doubt :
         {source.doubt, doubt_of_self_filter(source), doubt_of_view(source.view)}) {
      note(Rank::kRemark, what, doubt, findings);
    }
  }
  const std::string wanted = report->joint_states ? "rate of the joint states" : "~rate";
  if (rate < 0.8 * wanted_rate) {
    note(Rank::kRemark, "query", "the rate is lower than " + wanted + ": the machine is too busy",
         findings);
  }
  if (report->links_monitored == 0) {
    note(Rank::kRemark, "pose", "no link is looked up yet", findings);
  }
}

DiagnosticStatus input_diagnostics(const std::string& node, const CycleReport& report,
                                   std::size_t index, double rate, double now) {
  const SourceReport& source = report.sources[index];
  DiagnosticStatus status = make_diagnostic(node, "input " + source.name, report.findings);
  add_source_counts(source, rate, now, &status);
  if (!std::isnan(source.blind_skin)) add_view(source, &status);
  return status;
}

DiagnosticStatus pose_diagnostics(const std::string& node, const CycleReport& report) {
  DiagnosticStatus status = make_diagnostic(node, "pose", report.findings);
  add_value("links monitored", report.links_monitored, &status);
  add_value("links with a pose", report.links_known, &status);
  if (report.links_known > 0) add_value("age", format_text("%.3f s", report.pose_age), &status);
  if (report.joint_states) {
    const JointStateReport& joints = *report.joint_states;
    add_value("topic", joints.topic, &status);
    add_value("publishers", joints.publishers, &status);
    add_value("joint states received", joints.messages, &status);
    add_value("joint states used", joints.used, &status);
    add_value("joint states skipped: more came than can be answered", joints.skipped, &status);
    add_value("positions that cannot be used", joints.dropped, &status);
  }
  for (const Finding& finding : report.findings) {
    if (finding.rank == Rank::kPose) add_value("problem", finding.text, &status);
  }
  return status;
}

DiagnosticStatus query_diagnostics(const std::string& node, const CycleReport& report, double rate,
                                   double wanted_rate) {
  Findings findings;  // first the status as a whole
  const bool is_degraded = report.status.code == ProximityArray::DEGRADED;
  note(is_degraded ? Rank::kDegraded : Rank::kModel, "query", report.status.text, &findings);
  if (!findings.empty()) findings.front().since = report.findings.front().since;
  findings.insert(findings.end(), report.findings.begin(), report.findings.end());
  DiagnosticStatus status = make_diagnostic(node, "query", findings);
  const std::string wanted = report.joint_states ? "rate of the joint states" : "~rate";
  add_value("min_distance",
            std::isnan(report.min_distance) ? "not known" : millimetres(report.min_distance),
            &status);
  if (!report.speed_scale.empty()) add_value("speed_scale", report.speed_scale, &status);
  if (!report.counted_links.empty()) {
    add_value("links left out", report.counted_links, &status);
  }
  if (!report.zones.empty()) add_value("zones", report.zones, &status);
  add_value("live parameters",
            report.parameter_problem.empty() ? "as on the server" : report.parameter_problem,
            &status);
  add_value("rate", format_text("%.1f Hz", rate), &status);
  add_value(wanted, format_text("%.1f Hz", wanted_rate), &status);
  add_deadline(report, &status);
  add_value("markers drawn", report.markers_drawn, &status);
  add_value("memory of the query",
            format_text("%.1f MB", 1e-6 * static_cast<double>(report.query_memory)), &status);
  add_value("computation time, median", milliseconds(report.times.quantile(0.5)), &status);
  add_value("computation time, 99th percentile", milliseconds(report.times.quantile(0.99)),
            &status);
  add_parts(report, &status);
  return status;
}

}  // namespace ist
