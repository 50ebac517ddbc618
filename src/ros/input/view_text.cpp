#include "ros/input/view_text.h"

#include "ros/common/text.h"

namespace ist {

std::string doubt_of_view(const ViewReport& view) {
  if (!view.is_used || !view.has_drifted) return "";
  return format_text("its points on the robot are %.1f mm off, ", 1e3 * view.offset) +
         "more than three times what self_filter_view/position_error and angle_error say: "
         "calibrate "
         "the sensor; until then its self-filter drops all that is within the padding";
}

}  // namespace ist
