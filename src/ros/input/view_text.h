#pragma once

#include <string>

#include "ist_proximity/cloud/view_filter.h"

namespace ist {

/// A sentence when the points on the robot say that the sensor's pose in tf is wrong; else empty.
std::string doubt_of_view(const ViewReport& view);

}  // namespace ist
