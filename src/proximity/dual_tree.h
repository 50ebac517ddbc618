#pragma once

#include <cstdint>
#include <limits>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/tree/inner_sphere_tree.h"
#include "proximity/coherence/bvtt_front.h"
#include "proximity/supporting_planes.h"

namespace ist {

class PointRefinement;
class BoxRefinement;
class PointExtentRefinement;
class BoxExtentRefinement;

/// The input of a dual-tree traversal: a link's Inner Sphere Tree, posed, and the BVH of an index,
/// in the index's frame O, all in float. Lower bounds of the traversal have an error of `rounding`,
/// which the caller takes off; `prune_bound` and `inside_bound` contain it already.
template <class Bvh>
struct DualTreeInput {
  const InnerSphereTree* tree = nullptr;
  const Bvh* bvh = nullptr;  ///< of points or boxes, not empty
  float R_OL[9] = {};        ///< rotation, row-major
  float p_OL[3] = {};        ///< [m] translation
  float rounding = 0.0F;     ///< [m] largest error of a coordinate or a bound
  /// [m] Pairs whose lower bound is not below it are pruned.
  float prune_bound = std::numeric_limits<float>::infinity();
  /// [m] A point, or a part of a box, whose lower bound is at most this may be inside the link.
  float inside_bound = 0.0F;
  SupportCache* supports = nullptr;
  SupportingPlanes planes;
  BvttFront* front = nullptr;  ///< begun at this pose, or null
};

struct DualTreeResult {
  float pruned_bound = std::numeric_limits<float>::infinity();  ///< [m] least of all pruned pairs
  /// [m] Least cover distance of points that were pruned by more than their cover distances.
  float cover_bound = std::numeric_limits<float>::infinity();
  bool may_be_inside = false;  ///< some point's lower bound is at most `inside_bound`
  bool stopped = false;        ///< by the policy; `pruned_bound` bounds what was left
  std::uint64_t node_pairs = 0, leaf_pairs = 0;  ///< expanded
};

/// Branch and bound over pairs of a sphere node and a box node, depth first, nearest child first:
/// every point that may be nearer to the link than the prune bound is refined, those that may be
/// inside are only noted. A refinement returns the new prune bound, which never rises.
///
/// A refinement policy has
///   float bound_box(std::int32_t slot, std::int32_t child, const float* min, const float* max);
///                  // lower bound of all obstacles in a box of the BVH; -inf: may be inside
///   bool is_outside(std::int32_t tile, int lane);  // proven, where it may be inside
///   bool leaves_inside();  // another search finds what is inside, as soon as anything may be
///   float refine(std::int32_t tile, int lane, float lower_bound);  // returns the prune bound
///   bool update_planes(SupportingPlanes* planes);                  // true: they have changed
///   bool deadline_passed();
///   bool is_crowded(std::uint64_t node_pairs);  // too many points had to be measured: the
///   traversal is stopped
///   kBoundsPoints  // whether there is refined_bound(): [m] a lower bound of the distance to the
///                  // whole link of the point that refine() got last, which is outside; -inf:
///                  none.
///                  // Then also bool has_holes()
///   kHasExtent   // whether obstacles are spheres about points, or boxes that are larger on all
///   sides, for which
///   float largest_radius(std::int32_t slot, const float* min, const float* max);
///                  // bounds the radii in a box; `slot` is negative where the box is not known
/// With extents, the prune bound and DualTreeResult::pruned_bound are those of the spheres, and
/// what refine() and bound_box() get and return for a single obstacle or box is without a radius.
/// PointRefinement and BoxRefinement search without extents (refinement.h), PointExtentRefinement
/// and BoxExtentRefinement with them (extent_refinement.h).
DualTreeResult search_dual_tree(const DualTreeInput<PointBvh>& input, PointRefinement* policy);
DualTreeResult search_dual_tree(const DualTreeInput<BoxBvh>& input, BoxRefinement* policy);
DualTreeResult search_dual_tree(const DualTreeInput<PointBvh>& input,
                                PointExtentRefinement* policy);
DualTreeResult search_dual_tree(const DualTreeInput<BoxBvh>& input, BoxExtentRefinement* policy);

/// The box that is nearest to the inner spheres, if nearer than the prune bound.
struct NearestToInnerSpheres {
  float distance = std::numeric_limits<float>::infinity();  ///< [m] |p - c| - radius, with rounding
  std::int32_t tile = -1;                                   ///< of the box; -1: none
  int lane = 0;
  std::int32_t leaf = -1;  ///< of the sphere
  std::uint64_t node_pairs = 0, leaf_pairs = 0;
};
NearestToInnerSpheres find_nearest_to_inner_spheres(const DualTreeInput<BoxBvh>& input);

}  // namespace ist
