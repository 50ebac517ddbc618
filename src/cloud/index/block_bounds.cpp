// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/index/block_bounds.cpp"
#include "cloud/index/block_bounds.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#include "cloud/index/block_bounds-inl.h"

#if HWY_ONCE
namespace ist {
namespace {

// Relative error of a squared range that is computed in float, at most.
constexpr double kSquareError = 1e-6;
// Smaller squares are not that exact. [m^2]
constexpr double kSmallestSquare = 1e-30;

}  // namespace

BlockTransform::BlockTransform(const CropParameters& crop) {
  const Eigen::Matrix3d& rotation = crop.X_OS.linear();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      R[3 * row + column] = static_cast<float>(rotation(row, column));
    }
    t[row] = static_cast<float>(crop.X_OS.translation()[row]);
  }
  translation = static_cast<float>(crop.X_OS.translation().norm() * (1.0 + kSquareError));
  const double min_sq = crop.min_range_sq, max_sq = crop.max_range_sq;
  keep_from = static_cast<float>(
      min_sq > 0.0 ? std::max((1.0 + kSquareError) * min_sq, kSmallestSquare) : 0.0);
  drop_below = static_cast<float>(min_sq > kSmallestSquare ? (1.0 - kSquareError) * min_sq : 0.0);
  keep_to = static_cast<float>((1.0 - kSquareError) * max_sq);
  drop_above = static_cast<float>(std::max((1.0 + kSquareError) * max_sq, kSmallestSquare));
  constexpr double kLargest = std::numeric_limits<float>::max();
  believed = static_cast<float>(std::min(crop.believed_sq, kLargest));
}

BlockTransform BlockTransform::without_limits() const {
  BlockTransform transform = *this;
  transform.keep_from = transform.drop_below = 0.0F;
  transform.keep_to = transform.drop_above = transform.believed = std::numeric_limits<float>::max();
  return transform;
}

HWY_EXPORT(BoundBlock);

BlockState bound_block(const BlockTransform& transform, const BlockPixels& pixels,
                       BlockBounds* block) {
  return HWY_DYNAMIC_DISPATCH(BoundBlock)(transform, pixels, block);
}

}  // namespace ist
#endif
