#pragma once

#include <Eigen/Geometry>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/world_query.h"
#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// The repulsion of a link by clouds and by the objects of known worlds.
///
/// Each object is a term, with the direction n and the distance d of its closest points; all clouds
/// together are one more, with the direction of their blend. With s = 1 - d / influence_distance,
/// from 0 to 1, and w = max(0, 1 - (d - d_min) / smoothing)^2,
///   u = sum(w s n) / sum(w s),
/// and the wrench is gain * s_min * u. A term enters and ends with weight 0, so the vector is
/// continuous while the closest points of each object are: always between convex bodies. Each force
/// acts at the witness on the link.
/// @param of_clouds  Repulsion's for the clouds alone, not filtered; zero without clouds
/// @param clouds     the answer that it belongs to; CLEAR without clouds
/// @param objects    WorldQuery::near_objects() with the same influence distance
/// @param both       the nearer of clouds and objects
/// @returns zero when CLEAR; NaN when UNKNOWN, where `of_clouds` counts and is NaN, and where the
///          objects are missing that `both` has measured. Allocates nothing
RepulsiveWrench with_objects(const Eigen::Isometry3d& X_FL, const RepulsiveWrench& of_clouds,
                             const LinkProximity& clouds, Span<const NearObject> objects,
                             const LinkProximity& both, const RepulsionConfig& config);

}  // namespace ist
