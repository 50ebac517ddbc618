#include "ros/status/status_log.h"

#include <ist_proximity/ProximityArray.h>
#include <ros/console.h>

namespace ist {
namespace {

// [s] What passes by itself is not worth a line; nor is the same every second.
constexpr int kPatience = 3, kRepeat = 30;

}  // namespace

void StatusLog::update(std::uint8_t status, const std::string& text) {
  constexpr std::uint8_t kOk = ist_proximity::ProximityArray::OK;
  if (status == kOk) {
    if (told_ != kOk) ROS_INFO("the status is OK again");
    *this = StatusLog();
    return;
  }
  ++bad_;
  ++since_told_;
  const bool is_due =
      told_ == kOk ? bad_ >= kPatience : since_told_ >= (status == told_ ? kRepeat : kPatience);
  if (!is_due) return;
  ROS_WARN_STREAM(text);
  told_ = status;
  since_told_ = 0;
}

}  // namespace ist
