#include "ros/status/diagnostics_publisher.h"

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/console.h>

#include <utility>

#include "ros/common/publish.h"
#include "ros/status/diagnostics.h"

namespace ist {
namespace {

// [s] A status is logged once it has lasted this long, and again after the second time.
constexpr int kPatience = 3, kRepeat = 30;

}  // namespace

void DiagnosticsPublisher::log_status(std::uint8_t status, const std::string& text) {
  constexpr std::uint8_t kOk = ist_proximity::ProximityArray::OK;
  if (status == kOk) {
    if (logged_ != kOk) ROS_INFO("the status is OK again");
    logged_ = kOk;
    since_logged_ = 0;
    return;
  }
  if (++since_logged_ < (status == logged_ ? kRepeat : kPatience)) return;
  ROS_WARN_STREAM(text);
  logged_ = status;
  since_logged_ = 0;
}

DiagnosticsPublisher::DiagnosticsPublisher(ros::NodeHandle nh, const std::string& node,
                                           const ServerConfig& config)
    : node_(node),
      rate_(config.rate),
      contacts_wanted_(config.contacts_wanted),
      publisher_(nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10)),
      last_time_(std::chrono::steady_clock::now()) {}

/// Notes for how long there has been a finding of each kind.
void DiagnosticsPublisher::note_since(std::chrono::steady_clock::time_point now,
                                      Findings* findings) {
  std::map<std::pair<std::string, Rank>, std::chrono::steady_clock::time_point> since;
  for (Finding& finding : *findings) {
    const auto known = since_.find({finding.what, finding.rank});
    const auto begin = known == since_.end() ? now : known->second;
    since[{finding.what, finding.rank}] = begin;
    finding.since = std::chrono::duration<double>(now - begin).count();
  }
  since_ = std::move(since);
}

void DiagnosticsPublisher::publish(CycleReport report, const ModelState& model,
                                   const ContactModel* contacts, std::uint64_t triggers) {
  // The loader itself logs its progress until the model is ready.
  if (model.is_ready()) {
    log_status(report.status.code, report.status.text);
  }
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::duration<double> interval = now - last_time_;
  const auto rate_since = [&](std::uint64_t count, std::uint64_t last) {
    return static_cast<double>(count - last) / interval.count();
  };

  const double rate = rate_since(report.cycles, last_cycles_);
  const double wanted_rate = report.joint_states ? rate_since(triggers, last_triggers_) : rate_;
  add_remarks(rate, wanted_rate, &report);
  note_model(model, &report.findings);
  note_since(now, &report.findings);
  diagnostic_msgs::DiagnosticArray message;
  message.header.stamp = ros::Time::now();
  last_messages_.resize(report.sources.size());
  for (std::size_t i = 0; i < report.sources.size(); ++i) {
    const std::uint64_t messages = report.sources[i].messages;
    message.status.push_back(input_diagnostics(
        node_, report, i, rate_since(messages, last_messages_[i]), message.header.stamp.toSec()));
    last_messages_[i] = messages;
  }
  message.status.push_back(pose_diagnostics(node_, report));
  message.status.push_back(query_diagnostics(node_, report, rate, wanted_rate));
  message.status.push_back(
      model_diagnostics(node_, report.findings, model, contacts, contacts_wanted_));
  publish_message(publisher_, message);

  last_time_ = now;
  last_cycles_ = report.cycles;
  last_triggers_ = triggers;
}

}  // namespace ist
