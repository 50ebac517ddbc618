#pragma once

#include <Eigen/Core>
#include <cmath>

#include "internal/bvh/box_node.h"

namespace ist {

/// Axis-aligned box: x, y, z [m] and 0, which fit one SIMD register.
struct PaddedBox {
  Eigen::Array4f min, max;

  void extend(const PaddedBox& other) {
    min = min.min(other.min);
    max = max.max(other.max);
  }
  /// Computed number by number: often they were just written so, and a vector load would wait.
  float diagonal_sq() const {
    const float x = max[0] - min[0], y = max[1] - min[1], z = max[2] - min[2];
    return x * x + y * y + z * z;
  }
  float diagonal() const { return std::sqrt(diagonal_sq()); }
};

// Boxes side by side: a BoxNode, or a struct with the same members for its boxes.

/// Moves all slots far away.
template <typename Boxes>
void clear_boxes(Boxes* boxes) {
  for (int k = 0; k < kBoxWidth; ++k) {
    boxes->min_x[k] = boxes->min_y[k] = boxes->min_z[k] = kFarAway;
    boxes->max_x[k] = boxes->max_y[k] = boxes->max_z[k] = kFarAway;
  }
  boxes->count = 0;
}

/// Fills the next slot. @returns its number
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

/// The box in slot k.
template <typename Boxes>
PaddedBox box_in(const Boxes& boxes, int k) {
  return {{boxes.min_x[k], boxes.min_y[k], boxes.min_z[k], 0.0F},
          {boxes.max_x[k], boxes.max_y[k], boxes.max_z[k], 0.0F}};
}

/// The smallest box around those in the used slots, of which there is one at least.
template <typename Boxes>
PaddedBox bounds_of(const Boxes& boxes) {
  if (boxes.count == kBoxWidth) {  // Eigen turns it into SIMD
    using Lanes = Eigen::Map<const Eigen::Array<float, kBoxWidth, 1>>;
    const auto least = [](const float* v) { return Lanes(v).minCoeff(); };
    const auto greatest = [](const float* v) { return Lanes(v).maxCoeff(); };
    return {{least(boxes.min_x), least(boxes.min_y), least(boxes.min_z), 0.0F},
            {greatest(boxes.max_x), greatest(boxes.max_y), greatest(boxes.max_z), 0.0F}};
  }
  PaddedBox bounds = box_in(boxes, 0);
  for (int k = 1; k < boxes.count; ++k) bounds.extend(box_in(boxes, k));
  return bounds;
}

}  // namespace ist
