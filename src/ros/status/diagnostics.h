#pragma once

#include <diagnostic_msgs/DiagnosticStatus.h>
#include <ist_proximity/ProximityArray.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ros/model/model_loader.h"
#include "ros/poses/joint_state_listener.h"
#include "ros/status/status.h"

namespace ist {

/// Computation times of the last thousand cycles. Not thread safe.
class CycleTimes {
 public:
  void add(double seconds);
  double quantile(double q) const;  ///< [s] 0.5: median; NaN without any

 private:
  static constexpr std::size_t kKept = 1000;
  std::vector<double> ring_;
  std::size_t total_ = 0;
};

/// What the cycle thread leaves for the diagnostics thread.
struct CycleReport {
  std::uint8_t status = 0;
  std::string text;
  std::vector<SourceFacts> sources;
  std::vector<Verdict> verdicts;
  std::vector<std::string> pose_problems;
  std::string transform_problem;                ///< what tf's listener kept out
  std::optional<JointStateFacts> joint_states;  ///< with pose_source joint_states
  std::size_t links_known = 0, links_monitored = 0;
  double pose_age = 0.0;             ///< [s] of the common instant, when any link is known
  std::size_t cycles = 0;            ///< since the start, those without a model too
  CycleTimes times;                  ///< of those with one
  std::size_t deadlines_missed = 0;  ///< cycles whose query was broken off, since the start
  std::size_t markers_drawn = 0;     ///< messages on ~markers, drawn while somebody listens
};

// One DiagnosticStatus each; `node` goes before every name. Pure functions.
/// @param rate  [Hz] of its messages since the last call
diagnostic_msgs::DiagnosticStatus input_diagnostics(const std::string& node,
                                                    const SourceFacts& source,
                                                    const Verdict& verdict, double rate,
                                                    double now);
diagnostic_msgs::DiagnosticStatus pose_diagnostics(const std::string& node,
                                                   const CycleReport& report);
/// @param rate         [Hz] that was reached since the last call
/// @param wanted_rate  [Hz] ~rate, or that of the joint states
diagnostic_msgs::DiagnosticStatus query_diagnostics(const std::string& node,
                                                    const CycleReport& report, double rate,
                                                    double wanted_rate);
/// @param contacts  null: none yet, or not wanted
diagnostic_msgs::DiagnosticStatus model_diagnostics(const std::string& node,
                                                    const ModelState& state,
                                                    const ContactModel* contacts,
                                                    bool contacts_wanted);

}  // namespace ist
