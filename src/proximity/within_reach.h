#pragma once

#include <algorithm>

#include "internal/cloud/largest_range.h"
#include "ist_proximity/proximity/proximity_query.h"

namespace ist {

/// A query's settings with a range and a margin that bounds can be added to: with larger ones,
/// rounding would be larger than all distances that there can be.
inline QueryConfig within_reach(QueryConfig config) {
  config.max_distance = std::min(config.max_distance, kLargestRange);
  config.margin = std::min(config.margin, kLargestRange);
  return config;
}

}  // namespace ist
