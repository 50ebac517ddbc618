#pragma once

#include <string>

#include "ros/parameters/parameter_reader.h"

namespace ist {

/// How dynamic_reconfigure shows a live parameter.
struct Slider {
  double max = 0.0;     ///< end of the slider; the parameter itself may be larger
  std::string tooltip;  ///< name, unit and meaning
};

/// @param max_distance  [m] ~max_distance, which limits the influence distance
Slider slider_of(const Tunable& tunable, double max_distance);

}  // namespace ist
