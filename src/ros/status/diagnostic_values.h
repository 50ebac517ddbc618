#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <cstddef>
#include <cstdint>
#include <string>

namespace ist {

// Helpers to fill a DiagnosticStatus.

/// Makes the status OK named "NODE: WHAT".
diagnostic_msgs::DiagnosticStatus make_diagnostic(const std::string& node, const std::string& what);

/// Raises the level and replaces the message, unless the level is as high already.
void raise(std::uint8_t level, const std::string& message,
           diagnostic_msgs::DiagnosticStatus* status);

void add_value(const std::string& key, const std::string& value,
               diagnostic_msgs::DiagnosticStatus* status);
void add_value(const std::string& key, std::size_t value,
               diagnostic_msgs::DiagnosticStatus* status);

std::string milliseconds(double seconds);
std::string millimetres(double metres);

}  // namespace ist
