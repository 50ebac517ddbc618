#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>

#include "internal/cloud/point_bvh.h"
#include "internal/geometry/distance_field.h"
#include "proximity/coherence/field_front.h"
#include "proximity/field_queue.h"
#include "proximity/supporting_planes.h"

namespace ist {

class PointRefinement;

/// The input of a field search: a link's field of distances and the BVH of an index of points, in
/// the index's frame O, all in float. Lower bounds of the search have an error of `rounding`, which
/// the caller takes off; `prune_bound` contains it already.
struct FieldSearchInput {
  const DistanceField* field = nullptr;  ///< not empty
  const PointBvh* bvh = nullptr;         ///< not empty
  FieldQueue* queue = nullptr;           ///< empty; the search leaves anything in it
  FieldFront* front = nullptr;           ///< begun, and ended by the search; null: there is none
  float R_LO[9] = {};                    ///< rotation, row-major
  float p_LO[3] = {};                    ///< [m] translation
  float rounding = 0.0F;                 ///< [m] largest error of a coordinate or a bound
  /// [m] What has a lower bound that is not below it is pruned.
  float prune_bound = std::numeric_limits<float>::infinity();
  bool is_exact = false;  ///< the tolerance is 0
  /// [m] So much more is proven than the prune bound asks for: it serves the poses to come.
  float ahead = 0.0F;
  SupportingPlanes planes;  ///< in O
  float support = 0.0F;     ///< [m] of the whole link along their normal
};

struct FieldSearchResult {
  /// [m] Least lower bound of the signed distances of all that is pruned.
  float pruned_bound = std::numeric_limits<float>::infinity();
  /// [m] Every place that is nearer than this to a point is outside; not positive: unknown.
  float outside_bound = std::numeric_limits<float>::infinity();
  bool has_inside = false;  ///< a point is inside, and was measured
  bool has_time = true;     ///< false: the deadline passed; `pruned_bound` bounds what was left
  bool gave_up = false;     ///< another search is better
  std::uint64_t nodes = 0, tiles = 0;  ///< that were expanded
};

/// Bounds that a field has of a place, with the rounding taken off.
struct FieldPlace {
  float outside = 0.0F;  ///< [m] every place that is nearer is outside; not positive: unknown
  float surface = 0.0F;  ///< [m] no surface is nearer
  float within = std::numeric_limits<float>::infinity();  ///< [m] some surface is no farther
};

/// @param field     not empty
/// @param rounding  [m] error of the place
FieldPlace look_up_field(const DistanceField& field, const Eigen::Vector3d& p_L, float rounding);

/// Branch and bound over the boxes of an index of points for a whole link, best first. A box is
/// bounded by the field's distance at its centre less its radius, by the distances at the corners
/// of the box above it (see DistanceField), and by the link's supporting plane; a point by its own
/// look-up. So nearly always a single point is measured exactly, the nearest one. What may be
/// inside comes first, by how deep it may be: a box by its farthest corner from a surface point
/// that the field has for the node at its centre. A field without depths gives up where a point is
/// inside.
///
/// A link that has moved little since its last search looks only at parts of the index that the
/// front's bounds do not prune. No front is left where a point is inside.
FieldSearchResult search_field(const FieldSearchInput& input, PointRefinement* policy);

}  // namespace ist
