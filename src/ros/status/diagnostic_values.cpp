#include "ros/status/diagnostic_values.h"

#include "ros/common/text.h"

namespace ist {

using diagnostic_msgs::DiagnosticStatus;

DiagnosticStatus make_diagnostic(const std::string& node, const std::string& what) {
  DiagnosticStatus status;
  status.name = node + ": " + what;
  status.hardware_id = node;
  status.level = DiagnosticStatus::OK;
  status.message = "OK";
  return status;
}

void raise(std::uint8_t level, const std::string& message, DiagnosticStatus* status) {
  if (level <= static_cast<std::uint8_t>(status->level)) return;
  status->level = static_cast<decltype(status->level)>(level);
  status->message = message;
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

}  // namespace ist
