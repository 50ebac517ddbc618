#pragma once

#include <cstdint>
#include <string>

namespace ist {

/// Logs why the status is not OK, once that has lasted a while, and when it is OK again, so that
/// the reason stands on the terminal too. One thread.
class StatusLog {
 public:
  /// Must be called once a second.
  void update(std::uint8_t status, const std::string& text);

 private:
  std::uint8_t logged_ = 0;  ///< the status that was logged last
  int bad_ = 0;              ///< [s] for which the status has not been OK
  int since_logged_ = 0;     ///< [s]
};

}  // namespace ist
