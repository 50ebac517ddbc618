#pragma once

#include <limits>

#include "ist_proximity/cloud/ingest.h"

namespace ist::test {

/// Ingest that leaves nothing out: what is compared with a truth of all points.
/// @param thin  whether the points that repulsion needs are made too
inline IngestConfig whole_cloud(bool thin = true) {
  IngestConfig config;
  config.min_range = 0.0;
  config.max_range = std::numeric_limits<double>::infinity();
  config.self_filter = false;
  config.thin = thin;
  return config;
}

}  // namespace ist::test
