#pragma once

#include <cstddef>
#include <cstdint>

#include "internal/bvh/traversal_stack.h"

namespace ist {

/// Children of a node, side by side for SIMD.
constexpr int kBoxWidth = 16;

/// Coordinates of unused slots [m]: so far away that no bound comes near, and still with a finite
/// square.
constexpr float kFarAway = 1e15F;

/// Levels of nodes that a hierarchy has at most (see BoxHierarchy), for stack_capacity().
constexpr std::size_t kMaxBoxLevels = full_tree_levels(kBoxWidth);

/// The axis-aligned boxes [m] of up to sixteen children, in the frame of the hierarchy.
struct alignas(64) BoxNode {
  float min_x[kBoxWidth], min_y[kBoxWidth], min_z[kBoxWidth];
  float max_x[kBoxWidth], max_y[kBoxWidth], max_z[kBoxWidth];
  std::int32_t child[kBoxWidth];  ///< >= 0: node; < 0: tile ~child
  std::int32_t count;             ///< used slots, at the front
};

}  // namespace ist
