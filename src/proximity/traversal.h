#pragma once

#include <cstdint>
#include <limits>

#include "internal/cloud/box_bvh.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/tree/inner_sphere_tree.h"
#include "proximity/front.h"
#include "proximity/supports.h"

namespace ist {

constexpr std::uint64_t kNever = std::numeric_limits<std::uint64_t>::max();

/// One descent of a link's tree against one index of points or boxes, in its own float coordinates
/// (frame O). Everything that a query decides by comparing is here; what it decides exactly is
/// left to `candidate`.
struct Traversal {
  // What descends.
  const SphereNode* sphere_nodes = nullptr;
  const SphereLeaf* sphere_leaves = nullptr;
  const BoxNode* box_nodes = nullptr;
  const PointBvh* points = nullptr;    ///< either these
  const BoxTile* box_tiles = nullptr;  ///< or these
  std::int32_t box_root = 0;
  float R_OL[9] = {};  ///< rotation, row-major
  float p_OL[3] = {};  ///< [m] translation

  /// Every part of the link lies behind a plane across `normal`: none of its points x has
  /// normal . x > offset + support [m]. So a point p is at least normal . p - offset - support away
  /// from the part, and at least as far as from what the plane leaves of its sphere. Spheres alone
  /// tell little where obstacles are flat and far: their caps before the plane are nearer than the
  /// part. May change from `aim`. Unit vector; zero, and infinite: no planes are known.
  float normal[3] = {};
  float offset = std::numeric_limits<float>::infinity();
  float rounding = 0.0F;         ///< [m] largest error of a coordinate
  Supports* supports = nullptr;  ///< of the link's parts

  /// [m] Pairs whose bound is not below it are dropped; may only shrink, also from `candidate`.
  float threshold = std::numeric_limits<float>::infinity();
  /// [m] A point (or part of a box) whose bound is at most this may be inside; pairs that may hold
  /// one are kept.
  float interior = 0.0F;

  /// Called for each point whose lower bound is below the threshold (exact descent only).
  void (*candidate)(void* context, std::int32_t tile, int lane, float bound) = nullptr;
  /// Called when `inner_*` have changed: that point is no farther than `inner_distance`, where the
  /// link has no holes (exact descent only; null: nobody asks).
  void (*nearer)(void* context) = nullptr;
  /// Called once when so many node pairs have been expanded: to choose `normal` anew.
  void (*aim)(void* context) = nullptr;
  std::uint64_t aim_after = kNever;
  /// Called every few pairs; true ends the descent.
  bool (*expired)(void* context) = nullptr;
  void* context = nullptr;

  /// Where descents have ended before, told of the pose; this one goes on from there, and its end
  /// is kept (exact descent only; null: nowhere).
  Front* front = nullptr;

  // What came of it.
  float dropped = std::numeric_limits<float>::infinity();  ///< [m] smallest bound of a dropped pair
  bool may_be_inside = false;  ///< some point's bound is at most `interior`
  bool stopped = false;        ///< `expired` ended it; the bounds of what was left are in `dropped`
  /// [m] smallest |p - c| - inner; from an exact descent only if below what it is at first
  float inner_distance = std::numeric_limits<float>::infinity();
  std::int32_t inner_tile = -1;  ///< of that point or box
  int inner_lane = 0;
  std::int32_t inner_leaf = -1;  ///< of the sphere
  std::uint64_t node_pairs = 0, leaf_pairs = 0;
};

/// Finds the point (or box) of least inner distance: an upper bound, cheaply. Fills `inner_*`.
void descend_inner(Traversal* traversal);

/// Hands every point (or box) that may be nearer than the threshold to `candidate`, nearest pairs
/// first.
void descend_exact(Traversal* traversal);

}  // namespace ist
