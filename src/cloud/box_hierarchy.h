#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/point_index.h"

namespace ist {

/// Axis-aligned box; x, y, z [m] and 0, which fit one SIMD register.
struct PaddedBox {
  Eigen::Array4f min, max;

  void extend(const PaddedBox& other) {
    min = min.min(other.min);
    max = max.max(other.max);
  }
  float diagonal() const { return (max - min).matrix().norm(); }
};

/// A leaf (a tile of points, or a box) on its way to its place in the hierarchy.
struct HierarchyItem {
  Eigen::Vector3f center;  ///< [m] twice the middle of its box
  std::int32_t leaf;
};

/// Orders leaves so that nodes can be filled with sixteen consecutive children on every level:
/// space is divided at medians across the longest side, at multiples of what a whole child holds.
void arrange(std::vector<HierarchyItem>* items);

/// Builds the nodes over leaves in the order given, level by level, the root last. Every node is
/// full but the last of each level. A leaf's child number is ~leaf.
/// @param boxes  by leaf
void write_nodes(const std::vector<HierarchyItem>& items, const std::vector<PaddedBox>& boxes,
                 std::vector<BoxNode>* nodes);

/// Of a node's children.
PaddedBox box_of(const BoxNode& node);

/// Another number at each call: tells one build of any index from all others. Thread safe.
std::uint64_t next_generation();

}  // namespace ist
