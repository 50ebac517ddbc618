#pragma once

#include <cstdint>
#include <limits>

#include "ist_proximity/cloud/box_index.h"
#include "ist_proximity/cloud/point_index.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// One descent of a link's tree against one index of points or boxes, in its own float coordinates
/// (frame O). Everything that a query decides by comparing is here; what it decides exactly is
/// left to `candidate`.
struct Traversal {
  // What descends.
  const SphereNode* sphere_nodes = nullptr;
  const SphereLeaf* sphere_leaves = nullptr;
  const BoxNode* box_nodes = nullptr;
  const PointTile* tiles = nullptr;    ///< either these
  const BoxTile* box_tiles = nullptr;  ///< or these
  std::int32_t box_root = 0;
  float R_OL[9] = {};  ///< rotation, row-major
  float p_OL[3] = {};  ///< [m] translation

  /// [m] Pairs whose bound is not below it are dropped; may only shrink, also from `candidate`.
  float threshold = std::numeric_limits<float>::infinity();
  /// [m] A point (or part of a box) whose bound is at most this may be inside; pairs that may hold
  /// one are kept.
  float interior = 0.0F;

  /// Called for each point whose lower bound is below the threshold (exact descent only).
  void (*candidate)(void* context, std::int32_t tile, int lane, float bound) = nullptr;
  /// Called every few pairs; true ends the descent.
  bool (*expired)(void* context) = nullptr;
  void* context = nullptr;

  // What came of it.
  float dropped = std::numeric_limits<float>::infinity();  ///< [m] smallest bound of a dropped pair
  bool may_be_inside = false;  ///< some point's bound is at most `interior`
  bool stopped = false;        ///< `expired` ended it; the bounds of what was left are in `dropped`
  float inner_distance = std::numeric_limits<float>::infinity();  ///< [m] smallest |p - c| - inner
  std::int32_t inner_tile = -1;                                   ///< of that point or box
  int inner_lane = 0;
  std::int32_t inner_leaf = -1;  ///< of the ball
  std::uint64_t node_pairs = 0, leaf_pairs = 0;
};

/// Finds the point (or box) of least inner distance: an upper bound, cheaply. Fills `inner_*`.
void descend_inner(Traversal* traversal);

/// Hands every point (or box) that may be nearer than the threshold to `candidate`, nearest pairs
/// first.
void descend_exact(Traversal* traversal);

}  // namespace ist
