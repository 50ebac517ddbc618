#pragma once

#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"
#include "ros/status/cycle_report.h"
#include "ros/status/status_log.h"

namespace ist {

/// Publishes /diagnostics and logs why the status is not OK. Rates count from one call to the next.
/// One thread.
class DiagnosticsPublisher {
 public:
  /// @param node  name of the node, as it begins each status' name
  DiagnosticsPublisher(ros::NodeHandle nh, const std::string& node, const ServerConfig& config);

  /// Must be called once a second.
  /// @param report    of the last cycle, with the joint states where they trigger the cycles
  /// @param contacts  null: none yet, or not wanted
  /// @param triggers  joint states that have triggered a cycle since the start
  void publish(const CycleReport& report, const ModelState& model, const ContactModel* contacts,
               std::uint64_t triggers);

 private:
  const std::string node_;
  const double rate_;  ///< [Hz] ~rate
  const ContactsWanted contacts_wanted_;
  ros::Publisher publisher_;
  StatusLog status_log_;

  // The last call.
  std::chrono::steady_clock::time_point last_time_;
  std::size_t last_cycles_ = 0;
  std::uint64_t last_triggers_ = 0;
  std::vector<std::uint64_t> last_messages_;  ///< by source
};

}  // namespace ist
