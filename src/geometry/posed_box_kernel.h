#pragma once

#include "internal/geometry/triangle_bvh.h"

namespace ist {

/// A box that is axis-aligned in a frame O, as the kernel of TriangleBvh::closest_to_box takes it:
/// in float, relative to its own centre [m].
struct PosedBox {
  float center_M[3];           ///< from the centre of the mesh's bounding box
  float rotation[3][3];        ///< the mesh's frame M -> O
  float half_O[3], half_M[3];  ///< of the box, and of its bounding box in M
  float slack;                 ///< no bound is wrong by more, because of rounding
  /// A plane that separates the box from what is in n.x < offset + distance; n in M, unit. The
  /// bound of this plane is the least there is, -inf, until one is known.
  float normal_M[3] = {0.0F, 0.0F, 0.0F};
  float offset = -std::numeric_limits<float>::infinity();
};

/// Lower bounds [m] of the distances of a node's children from a box; 0 where they may overlap.
void posed_box_bounds(const TriangleBvh::Boxes& node, const PosedBox& box,
                      float bounds[TriangleBvh::kWidth]);

}  // namespace ist
