#pragma once

#include <limits>

#include "ist_proximity/cloud/ingest.h"

namespace ist::test {

/// Configuration of an ingest that keeps all points, for comparison with a truth of all points.
/// @param thin  also make the thinned cloud that repulsion needs
inline IngestConfig whole_cloud(bool thin = true) {
  IngestConfig config;
  config.min_range = 0.0;
  config.max_range = std::numeric_limits<double>::infinity();
  config.self_filter = false;
  config.thin = thin;
  return config;
}

}  // namespace ist::test
