#pragma once

#include <chrono>
#include <string>

#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Shows how far packing is: as a bar that is drawn over itself where stderr is a terminal, else as
/// a line in the log every few seconds. One thread at a time.
class ProgressReport {
 public:
  ProgressReport();
  ~ProgressReport() { finish(); }

  void update(const ModelProgress& progress);
  /// Ends the line of the bar.
  void finish();

  /// "packing link forearm (4 of 11), 37 % of the robot done"
  static std::string sentence(const ModelProgress& progress);

 private:
  bool is_terminal_;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point next_;
};

}  // namespace ist
