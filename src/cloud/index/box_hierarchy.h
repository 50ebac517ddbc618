#pragma once

#include <Eigen/Core>
#include <cmath>
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
  /// Number by number: often they were just written so, and a vector of them would have to wait.
  float diagonal_sq() const {
    const float x = max[0] - min[0], y = max[1] - min[1], z = max[2] - min[2];
    return x * x + y * y + z * z;
  }
  float diagonal() const { return std::sqrt(diagonal_sq()); }
};

/// Of a BoxNode or BoxTile: all its slots far away.
template <typename Boxes>
void clear_boxes(Boxes* boxes) {
  for (int k = 0; k < kPointWidth; ++k) {
    boxes->min_x[k] = boxes->min_y[k] = boxes->min_z[k] = kFarAway;
    boxes->max_x[k] = boxes->max_y[k] = boxes->max_z[k] = kFarAway;
  }
  boxes->count = 0;
}

/// Fills the next slot of a BoxNode or BoxTile. @returns its number
template <typename Boxes>
int append_box(const PaddedBox& box, Boxes* boxes) {
  const int k = boxes->count++;
  boxes->min_x[k] = box.min[0];
  boxes->min_y[k] = box.min[1];
  boxes->min_z[k] = box.min[2];
  boxes->max_x[k] = box.max[0];
  boxes->max_y[k] = box.max[1];
  boxes->max_z[k] = box.max[2];
  return k;
}

/// In a slot of a BoxNode or BoxTile.
template <typename Boxes>
PaddedBox box_in(const Boxes& boxes, int k) {
  return {{boxes.min_x[k], boxes.min_y[k], boxes.min_z[k], 0.0F},
          {boxes.max_x[k], boxes.max_y[k], boxes.max_z[k], 0.0F}};
}

/// Of the used slots of a BoxNode or BoxTile, of which there is one at least.
template <typename Boxes>
PaddedBox box_around(const Boxes& boxes) {
  if (boxes.count == kPointWidth) {  // Eigen turns it into SIMD
    using Lanes = Eigen::Map<const Eigen::Array<float, kPointWidth, 1>>;
    const auto least = [](const float* v) { return Lanes(v).minCoeff(); };
    const auto greatest = [](const float* v) { return Lanes(v).maxCoeff(); };
    return {{least(boxes.min_x), least(boxes.min_y), least(boxes.min_z), 0.0F},
            {greatest(boxes.max_x), greatest(boxes.max_y), greatest(boxes.max_z), 0.0F}};
  }
  PaddedBox around = box_in(boxes, 0);
  for (int k = 1; k < boxes.count; ++k) around.extend(box_in(boxes, k));
  return around;
}

/// What is to become a node's child.
struct HierarchyChild {
  PaddedBox box;
  std::int32_t child;  ///< as in BoxNode
};

/// Groups boxes of any kind, sixteen together. Keeps its working memory. Not thread safe.
class BoxHierarchy {
 public:
  /// Space is divided at medians across the longest side, at multiples of sixteen boxes.
  /// @returns numbers of the boxes; sixteen consecutive ones belong together
  const std::vector<std::uint32_t>& arrange(const std::vector<HierarchyChild>& children);

  /// Appends nodes over these children, all full but the last one.
  void append_nodes(const std::vector<HierarchyChild>& children, std::vector<BoxNode>* nodes);

  /// Appends nodes over those that are there, level by level up to the root, which is the last one.
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

/// Another number at each call: tells one build of any index from all others. Thread safe.
std::uint64_t next_build_id();

}  // namespace ist
