#pragma once

#include <cstdint>
#include <string>

namespace ist {

/// Tells the log why the status is not OK, once that has lasted, and when it is OK again: whoever
/// looks at the terminal first finds it there. One thread.
class StatusLog {
 public:
  /// To be called once a second.
  void update(std::uint8_t status, const std::string& text);

 private:
  std::uint8_t told_ = 0;  ///< status
  int bad_ = 0;            ///< [s]
  int since_told_ = 0;     ///< [s]
};

}  // namespace ist
