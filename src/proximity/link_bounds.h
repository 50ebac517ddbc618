#pragma once

#include <cstdint>
#include <limits>

#include "internal/bvh/box_node.h"
#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_tile.h"
#include "internal/geometry/distance_field.h"
#include "ist_proximity/tree/inner_sphere_tree.h"
#include "proximity/search_queue.h"

namespace ist {

/// A link in the frame O of an index, in float.
struct PlacedLink {
  const DistanceField* field = nullptr;  ///< null: the tree bounds
  const InnerSphereTree* tree = nullptr;
  bool is_closed = false;  ///< of the link's solid
  float R_LO[9] = {};      ///< rotation, row-major
  float p_LO[3] = {};      ///< [m] translation
  float rounding = 0.0F;   ///< [m] largest error of a coordinate or a bound
  /// The link's root sphere, in the frame O [m]. A radius of infinity: it bounds nothing.
  float center[3] = {};
  float radius = std::numeric_limits<float>::infinity();
  /// The link is below the plane normal . p = height. Zero: there is no plane.
  float normal[3] = {};
  float height = std::numeric_limits<float>::infinity();  ///< [m] rounded up
};

/// The bound [m] of what may be inside, at any depth: it is looked at before all others.
constexpr float kMayBeInside = -kFarAway;

/// Bounds of a node's children, or of a tile's points or boxes.
struct alignas(64) Bounds {
  float distance[kBoxWidth];                       ///< [m] lower bounds; negative: of the depth
  float outside[kBoxWidth];                        ///< [m] every place that is nearer is outside
  float surface[kBoxWidth];                        ///< [m] no surface is nearer
  float x[kBoxWidth], y[kBoxWidth], z[kBoxWidth];  ///< [m] in the link's frame
  float radius[kBoxWidth];                         ///< [m] as SearchQueue::Entry
};

/// Boxes side by side, in the frame O [m]: a node's children, or a tile's boxes.
struct BoxRows {
  template <class Boxes>
  explicit BoxRows(const Boxes& boxes)
      : min{boxes.min_x, boxes.min_y, boxes.min_z},
        max{boxes.max_x, boxes.max_y, boxes.max_z},
        count(boxes.count) {}
  const float* min[3];
  const float* max[3];
  int count;
};

/// Lower bounds [m] of the distance at the corners of a box.
struct Corners {
  alignas(64) float bound[8];
  float box_bound = 0.0F;  ///< [m] of the box itself
};

/// Bounds of places about a link. A place is bounded by the link's field of distances (see
/// DistanceField), or where there is none by the cover spheres of its tree; a box by its centre
/// less its radius, and by the distances at the corners of the box above it; both by the link's
/// supporting plane. Where little is to be proven, the link's root sphere may be enough for all
/// boxes of a node: it costs a tenth of the field, whose memory is cold in a first query. Bounds
/// have an error of `rounding`, which the caller takes off.
///
/// Signed distances of a closed solid fall by no more than the way, so that its bounds hold inside
/// as well. Near holes what is not known to be outside may be inside, at any depth that the field
/// does not exclude.
class LinkBounds {
 public:
  using Entry = SearchQueue::Entry;

  explicit LinkBounds(const PlacedLink& link) : link_(link) {}

  /// Places a box, given in the frame O.
  void place_box(const float* min, const float* max, Entry* box) const;
  /// [m] The height of a box above the supporting plane.
  float height(const Entry& box) const;

  /// Whether corners say anything about what is in a box with this bound.
  bool has_corners(const Entry& box, float bound) const;
  void bound_corners(const Entry& box, Corners* corners) const;
  /// @param parent   the box about them
  /// @param corners  of `parent`; null: not known
  /// @param enough   [m] a bound that is not below this need not be better
  /// @returns [m] in some box every point is no farther
  float bound_boxes(const BoxRows& boxes, const Entry& parent, const Corners* corners, float enough,
                    Bounds* bounds) const;
  /// @param box  about the tile
  /// @returns [m] some point is no farther
  float bound_points(const PointTile& tile, const Entry& box, float enough, Bounds* bounds) const;

 private:
  bool are_beyond_sphere(const BoxRows& boxes, float enough, Bounds* bounds) const;
  void bound_by_tree(int count, bool are_points, float enough, Bounds* bounds) const;

  const PlacedLink& link_;
};

/// Some slots, by whether they are below a limit.
struct SplitSlots {
  std::uint32_t below;   ///< bit k: slot k is
  float bound, outside;  ///< [m] the least of the slots that are not; kFarAway: there are none
};
/// @param slots   bit k: slot k is asked about
/// @param bounds  those of other slots are overwritten
SplitSlots split_slots(std::uint32_t slots, float limit, Bounds* bounds);

/// Bounds that a field has of a place, with the rounding taken off.
struct FieldPlace {
  float outside = 0.0F;  ///< [m] every place that is nearer is outside; not positive: unknown
  float surface = 0.0F;  ///< [m] no surface is nearer
  float within = std::numeric_limits<float>::infinity();  ///< [m] some surface is no farther
};

/// @param field     not empty
/// @param rounding  [m] error of the place
FieldPlace look_up_field(const DistanceField& field, const Eigen::Vector3d& p_L, float rounding);

}  // namespace ist
