#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"
#include "ros/status/cycle_report.h"

namespace ist {

/// Publishes /diagnostics, and logs why the status is not OK, once that has lasted a while, and
/// when it is OK again. Rates count from one call to the next. One thread.
class DiagnosticsPublisher {
 public:
  /// @param node  name of the node, as it begins each status' name
  DiagnosticsPublisher(ros::NodeHandle nh, const std::string& node, const ServerConfig& config);

  /// Must be called once a second.
  /// @param report    of the last cycle, with the joint states where they trigger the cycles
  /// @param contacts  null: none yet, or not wanted
  /// @param triggers  joint states that have triggered a cycle since the start
  void publish(CycleReport report, const ModelState& model, const ContactModel* contacts,
               std::uint64_t triggers);

 private:
  void log_status(std::uint8_t status, const std::string& text);
  void note_since(std::chrono::steady_clock::time_point now, Findings* findings);

  const std::string node_;
  const double rate_;  ///< [Hz] ~rate
  const ContactsWanted contacts_wanted_;
  ros::Publisher publisher_;

  // The last call.
  std::chrono::steady_clock::time_point last_time_;
  std::size_t last_cycles_ = 0;
  std::uint64_t last_triggers_ = 0;
  std::vector<std::uint64_t> last_messages_;  ///< by source
  /// Since when there has been a finding, by what it concerns and its kind.
  std::map<std::pair<std::string, Rank>, std::chrono::steady_clock::time_point> since_;
  std::uint8_t logged_ = 0;  ///< the status that was logged last
  int since_logged_ = 0;     ///< [s] for which the status has not been OK, or since it was logged
};

}  // namespace ist
