#pragma once

#include <Eigen/Geometry>
#include <cstddef>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// The repulsive wrench on a link from the other links of its robot, in the fixed frame, about the
/// link's origin.
///
/// A pair has the distance d and the unit vector n away from the other link, and d_min is the least
/// distance of this link's pairs:
///   u = sum(w n) / sum(w),  w = max(0, 1 - (d - d_min) / smoothing)^2,
/// over the pairs; force and torque are that of Repulsion: gain * s * u at the witnesses on the
/// link, s = 1 - d_min / influence_distance from 0 to 1. Another link that comes near does not make
/// it jump. Within one pair it is as continuous as the closest points are: where two places of the
/// same link are equally near, the direction changes at once.
///
/// @param link     index in the model
/// @param pairs    those of the query
/// @param answers  by pair
/// @param config   influence_distance, gain and smoothing are read
/// @returns zero when all pairs of the link are CLEAR, or where it has none; NaN when one of them
/// is
///          UNKNOWN, and where there is not one answer per pair. Allocates nothing. Thread safe.
RepulsiveWrench self_repulsion(std::size_t link, const Eigen::Isometry3d& X_FL,
                               Span<const LinkPair> pairs, Span<const PairProximity> answers,
                               const RepulsionConfig& config);

}  // namespace ist
