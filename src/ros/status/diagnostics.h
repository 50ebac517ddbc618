#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>

#include <cstddef>
#include <string>

#include "ist_proximity/contact/contact_model.h"
#include "ros/model/model_state.h"
#include "ros/status/cycle_report.h"
#include "ros/status/status.h"

namespace ist {

/// Adds what no status of a message says.
/// @param wanted_rate  [Hz] ~rate, or the rate of the joint states
void add_remarks(double rate, double wanted_rate, CycleReport* report);
/// Adds what is found of a model besides what a status says of it.
void note_model(const ModelState& state, Findings* findings);

// Pure functions that give one DiagnosticStatus each, of the report's findings and of numbers;
// `node` begins every name. Other programs read the keys, so they stay as they are.

/// @param index  of the source
/// @param rate   [Hz] of the source's messages since the last call
/// @param now    [s] ROS clock
diagnostic_msgs::DiagnosticStatus input_diagnostics(const std::string& node,
                                                    const CycleReport& report, std::size_t index,
                                                    double rate, double now);
diagnostic_msgs::DiagnosticStatus pose_diagnostics(const std::string& node,
                                                   const CycleReport& report);
/// @param rate         [Hz] reached since the last call
/// @param wanted_rate  [Hz] ~rate, or the rate of the joint states
diagnostic_msgs::DiagnosticStatus query_diagnostics(const std::string& node,
                                                    const CycleReport& report, double rate,
                                                    double wanted_rate);
/// @param contacts  null: none yet, or not wanted
diagnostic_msgs::DiagnosticStatus model_diagnostics(const std::string& node,
                                                    const Findings& findings,
                                                    const ModelState& state,
                                                    const ContactModel* contacts,
                                                    ContactsWanted contacts_wanted);

/// Makes the status named "NODE: WHAT", of what is found of it.
diagnostic_msgs::DiagnosticStatus make_diagnostic(const std::string& node, const std::string& what,
                                                  const Findings& findings);

struct Values {
  diagnostic_msgs::DiagnosticStatus* status;
  void operator()(const std::string& key, const std::string& value) const;
  void operator()(const std::string& key, std::size_t value) const {
    (*this)(key, std::to_string(value));
  }
};

std::string milliseconds(double seconds);
std::string millimetres(double metres);

}  // namespace ist
