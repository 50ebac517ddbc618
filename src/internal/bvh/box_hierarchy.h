#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/bvh/box_node.h"
#include "internal/bvh/padded_box.h"

namespace ist {

/// A future child of a node.
struct HierarchyChild {
  PaddedBox box;
  std::int32_t child;  ///< as in BoxNode
};

/// Builds the nodes of a box hierarchy bottom up, sixteen children a node. Keeps its working
/// memory. Not thread safe.
class BoxHierarchy {
 public:
  /// Orders boxes so that sixteen consecutive ones lie together: space is divided at medians across
  /// the longest side, at multiples of sixteen boxes.
  /// @returns numbers of the boxes in that order; valid until the next call
  const std::vector<std::uint32_t>& arrange(const std::vector<HierarchyChild>& children);

  /// Appends nodes over these children, all full but the last one.
  void append_nodes(const std::vector<HierarchyChild>& children, std::vector<BoxNode>* nodes);

  /// Appends nodes over those in `nodes`, level by level up to the root, which is the last one. All
  /// nodes of a level are full but the last one.
  void append_levels(std::vector<BoxNode>* nodes);

 private:
  struct Item {
    Eigen::Vector3f center;  // [m] twice the middle of its box
    std::uint32_t number;
  };
  void arrange_range(std::size_t first, std::size_t last);

  std::vector<Item> items_;
  std::vector<std::uint32_t> order_;
  std::vector<HierarchyChild> level_;
};

}  // namespace ist
