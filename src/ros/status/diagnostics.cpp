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
  // A laser scanner may never see the robot, so this concerns cameras only.
  if (counts.on_robot == 0 && (source.noun == "cloud" || source.noun == "image")) {
    return "no point of the " + source.noun +
           " is on the robot: if the sensor sees the robot, its transform or "
           "the URDF is wrong; if it does not, set self_filter: false";
  }
  return "";
}

void add_source_counts(const SourceReport& source, double rate, double now, const Values& add) {
  add("topic", source.topic);
  add("required", source.required ? "true" : "false");
  if (source.is_memory) {
    if (source.has_snapshot) {
      add("age", format_text("%.3f s", now - source.counts_from.toSec()));
      add("boxes in use", source.counts.used);
      add("time to remember", milliseconds(source.ingest_time));
    }
    add("voxels occupied", source.memory_occupied);
    add("voxels in memory", source.memory_voxels);
    return;
  }
  add("publishers", source.publishers);
  add("messages received", source.messages);
  if (!source.is_file) add("rate", format_text("%.1f Hz", rate));
  if (source.ahead > 0.0) add("stamps ahead", milliseconds(source.ahead));
  add("dropped: unusable", source.unusable);
  add("dropped: out of order", source.out_of_order);
  add("new starts: stamps went back", source.restarts);
  add("dropped: overtaken by a newer one", source.overtaken);
  add("shown on ~filtered_cloud", source.shown);
  if (!std::isnan(source.blind_skin)) {
    add("blind skin about the robot", millimetres(source.blind_skin));
  }
  if (source.has_snapshot) {
    if (!source.is_file) add("age", format_text("%.3f s", now - source.counts_from.toSec()));
    add("points received", source.counts.received);
    add("points used", source.counts.used);
    add("points on the robot", source.counts.on_robot);
    add("points in zones", source.counts.in_zones);
    add("points out of range", source.counts.out_of_range);
    add("points outside the region of interest", source.counts.outside_region);
    if (source.counts.noise > 0) add("points taken for noise", source.counts.noise);
    add("points NaN", source.counts.not_a_number);
    add("points infinite", source.counts.infinite);
    add("points too near", source.counts.too_near);
    add("points not believed", source.counts.not_believed);
    add("identical points", source.counts.at_one_place);
    add("share measured", format_text("%.3f", source.counts.measured_share()));
    add("time to ingest", milliseconds(source.ingest_time));
    add("time of the first answer with it", milliseconds(source.warm_up_time));
    add("memory of the cloud's index",
        format_text("%.1f MB", 1e-6 * static_cast<double>(source.snapshot_memory)));
  }
}

void add_view(const SourceReport& source, const Values& add) {
  const bool is_used = source.has_snapshot && source.view.is_used;
  add("self-filter", !source.by_view ? "padding" : is_used ? "view" : "padding, not an image");
  if (!is_used) return;
  const ViewReport& view = source.view;
  add("correction of the sensor's pose on the robot", millimetres(view.offset));
  add("correction of the sensor's orientation",
      format_text("%.2f deg", view.angle * 180.0 / 3.14159265358979323846));
  add("uncertainty of the corrected pose", millimetres(view.uncertainty));
  add("residual of the robot's surface", millimetres(view.residual));
  for (std::size_t i = 0; i < view.links.size() && i < source.view_links.size(); ++i) {
    const LinkView& link = view.links[i];
    add("blind skin of " + source.view_links[i], millimetres(link.blind_skin));
    add("unexplained points in the skin of " + source.view_links[i], link.unexplained);
  }
}

/// Adds the deadline, and the worst that it has cost since the last diagnostics.
void add_deadline(const CycleReport& report, const Values& add) {
  const DeadlineCost& worst = report.worst_deadline;
  add("deadline", report.deadline > 0.0 ? milliseconds(report.deadline) : "none");
  add("deadlines missed", report.deadlines_missed);
  add("links unfinished, most of a cycle", worst.unfinished);
  add("widest bounds of unfinished links", millimetres(worst.widest));
  add("links with unblended repulsion, most of a cycle", worst.unblended);
  add("links without penetration, most of a cycle", worst.no_penetration);
}

void add_parts(const CycleReport& report, const Values& add) {
  const std::array<const char*, kCycleParts> names = {"poses",       "query",   "repulsion",
                                                      "penetration", "message", "publishing"};
  for (std::size_t i = 0; i < kCycleParts; ++i) {
    const std::string name = std::string("time of ") + names[i];
    add(name + ", median", milliseconds(report.parts[i].quantile(0.5)));
    add(name + ", 99th percentile", milliseconds(report.parts[i].quantile(0.99)));
  }
}

}  // namespace

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
  Values{&status}("since", format_text("%.0f s", worst->since));
  return status;
}

void Values::operator()(const std::string& key, const std::string& value) const {
  diagnostic_msgs::KeyValue pair;
  pair.key = key;
  pair.value = value;
  status->values.push_back(pair);
}

std::string milliseconds(double seconds) { return format_text("%.3f ms", 1e3 * seconds); }
std::string millimetres(double metres) { return format_text("%.2f mm", 1e3 * metres); }

void add_remarks(double rate, double wanted_rate, CycleReport* report) {
  Findings* findings = &report->findings;
  for (const SourceReport& source : report->sources) {
    const std::string what = "input " + source.name;
    if (source.status.ok() && !source.problem.empty()) {
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
  const Values add{&status};
  add_source_counts(source, rate, now, add);
  if (!std::isnan(source.blind_skin)) add_view(source, add);
  return status;
}

DiagnosticStatus pose_diagnostics(const std::string& node, const CycleReport& report) {
  DiagnosticStatus status = make_diagnostic(node, "pose", report.findings);
  const Values add{&status};
  add("links monitored", report.links_monitored);
  add("links with a pose", report.links_known);
  if (report.links_known > 0) add("age", format_text("%.3f s", report.pose_age));
  if (report.joint_states) {
    const JointStateReport& joints = *report.joint_states;
    add("topic", joints.topic);
    add("publishers", joints.publishers);
    add("joint states received", joints.messages);
    add("joint states used", joints.used);
    add("joint states skipped: more came than can be answered", joints.skipped);
    add("positions that cannot be used", joints.dropped);
  }
  for (const Finding& finding : report.findings) {
    if (finding.rank == Rank::kPose) add("problem", finding.text);
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
  const Values add{&status};
  const std::string wanted = report.joint_states ? "rate of the joint states" : "~rate";
  add("min_distance",
      std::isnan(report.min_distance) ? "not known" : millimetres(report.min_distance));
  if (!report.speed_scale.empty()) add("speed_scale", report.speed_scale);
  if (!report.counted_links.empty()) add("links left out", report.counted_links);
  if (!report.zones.empty()) add("zones", report.zones);
  add("live parameters",
      report.parameter_problem.empty() ? "as on the server" : report.parameter_problem);
  add("rate", format_text("%.1f Hz", rate));
  add(wanted, format_text("%.1f Hz", wanted_rate));
  add_deadline(report, add);
  add("markers drawn", report.markers_drawn);
  add("memory of the query",
      format_text("%.1f MB", 1e-6 * static_cast<double>(report.query_memory)));
  add("computation time, median", milliseconds(report.times.quantile(0.5)));
  add("computation time, 99th percentile", milliseconds(report.times.quantile(0.99)));
  add_parts(report, add);
  return status;
}

}  // namespace ist
