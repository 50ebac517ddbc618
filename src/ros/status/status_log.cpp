#include "ros/status/status_log.h"

#include <ist_proximity/ProximityArray.h>
#include <ros/console.h>

namespace ist {
namespace {

// [s] A status is logged once it has lasted this long, and again after the second time.
constexpr int kPatience = 3, kRepeat = 30;

}  // namespace

void StatusLog::update(std::uint8_t status, const std::string& text) {
  constexpr std::uint8_t kOk = ist_proximity::ProximityArray::OK;
  if (status == kOk) {
    if (logged_ != kOk) ROS_INFO("the status is OK again");
    *this = StatusLog();
    return;
  }
  ++bad_;
  ++since_logged_;
  const bool is_due = logged_ == kOk ? bad_ >= kPatience
                                     : since_logged_ >= (status == logged_ ? kRepeat : kPatience);
  if (!is_due) return;
  ROS_WARN_STREAM(text);
  logged_ = status;
  since_logged_ = 0;
}

}  // namespace ist
