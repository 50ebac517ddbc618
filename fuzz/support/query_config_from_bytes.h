#pragma once

#include <cstdint>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/byte_reader.h"

namespace ist::fuzz {

constexpr double kPassed = 1e-12;  ///< [s] a deadline that has passed when the query asks first

/// Tolerances, ranges, margins and deadlines: none, passed at once, or never reached.
inline QueryConfig query_config_from(ByteReader* in) {
  constexpr double kTolerances[] = {0.0, 0.0, 1e-4, 0.001, 0.01};
  QueryConfig config;
  config.tolerance = kTolerances[in->below(5)];
  config.max_distance = in->between(0.01, 1.0);
  config.margin = in->flag() ? in->between(0.0, 0.05) : 0.0;
  config.relative_tolerance = in->flag() ? in->between(0.0, 1.0) : 0.0;
  const std::uint8_t kind = in->byte();
  config.deadline = kind > 220 ? kPassed : kind > 160 ? 1e3 : 0.0;
  return config;
}

}  // namespace ist::fuzz
