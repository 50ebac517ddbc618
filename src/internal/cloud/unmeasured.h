#pragma once

#include <string>

#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

/// Says why points were not measured: "2 are NaN, 1 are nearer than min_range".
std::string unmeasured(const IngestCounts& counts);

}  // namespace ist
