#include "ros/status/diagnostics_publisher.h"

#include <diagnostic_msgs/DiagnosticArray.h>

#include "ros/common/publish.h"
#include "ros/status/diagnostics.h"

namespace ist {

DiagnosticsPublisher::DiagnosticsPublisher(ros::NodeHandle nh, const std::string& node,
                                           const ServerConfig& config)
    : node_(node),
      rate_(config.rate),
      contacts_wanted_(config.contacts_wanted),
      publisher_(nh.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10)),
      last_time_(std::chrono::steady_clock::now()) {}

void DiagnosticsPublisher::publish(const CycleReport& report, const ModelState& model,
                                   const ContactModel* contacts, std::uint64_t triggers) {
  // The loader itself logs its progress until the model is ready.
  if (model.is_ready()) {
    status_log_.update(report.status.code, report.status.text);
  }
  const auto now = std::chrono::steady_clock::now();
  const std::chrono::duration<double> interval = now - last_time_;
  const auto rate_since = [&](std::uint64_t count, std::uint64_t last) {
    return static_cast<double>(count - last) / interval.count();
  };

  diagnostic_msgs::DiagnosticArray message;
  message.header.stamp = ros::Time::now();
  last_messages_.resize(report.sources.size());
  for (std::size_t i = 0; i < report.sources.size(); ++i) {
    const SourceReport& source = report.sources[i];
    message.status.push_back(input_diagnostics(node_, source, report.source_statuses[i],
                                               rate_since(source.messages, last_messages_[i]),
                                               message.header.stamp.toSec()));
    last_messages_[i] = source.messages;
  }
  message.status.push_back(pose_diagnostics(node_, report));
  const double wanted_rate = report.joint_states ? rate_since(triggers, last_triggers_) : rate_;
  message.status.push_back(
      query_diagnostics(node_, report, rate_since(report.cycles, last_cycles_), wanted_rate));
  message.status.push_back(model_diagnostics(node_, model, contacts, contacts_wanted_));
  publish_message(publisher_, message);

  last_time_ = now;
  last_cycles_ = report.cycles;
  last_triggers_ = triggers;
}

}  // namespace ist
