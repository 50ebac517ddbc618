#include "cloud/filters/crop.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "cloud/filters/crop_kernel.h"
#include "cloud/format/point_reader.h"

namespace ist {
namespace {

CropKernelParameters range_of(const CropParameters& pose) {
  CropKernelParameters range;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      range.R[3 * row + column] = pose.X_OS.linear()(row, column);
    }
    range.t[row] = pose.X_OS.translation()[row];
  }
  range.min_range_sq = pose.min_range_sq;
  range.max_range_sq = pose.max_range_sq;
  for (int axis = 0; axis < 3; ++axis) range.center[axis] = pose.region_center[axis];
  range.region_radius_sq = pose.region_radius_sq;
  return range;
}

// A block as it is read: in the sensor frame [m].
template <typename Scalar>
struct alignas(64) SensorBlock {
  Scalar x[kCropBatch], y[kCropBatch], z[kCropBatch];
};

// Four floats a point, as most drivers write them.
bool is_four_floats(const RawCloud& cloud) {
  return !cloud.is_double && !cloud.swap_bytes && cloud.point_step == 4 * sizeof(float) &&
         cloud.x == 0 && cloud.y == sizeof(float) && cloud.z == 2 * sizeof(float) &&
         reinterpret_cast<std::uintptr_t>(cloud.data) % sizeof(float) == 0 &&
         cloud.row_step % sizeof(float) == 0;
}

// Some points of a row, as they are in the message.
template <typename Scalar, bool kSwap>
void load(const RawCloud& cloud, const std::uint8_t* bytes, std::size_t count, std::size_t slot,
          SensorBlock<Scalar>* block) {
  for (std::size_t i = slot; i < slot + count; ++i, bytes += cloud.point_step) {
    block->x[i] = read<Scalar, kSwap>(bytes + cloud.x);
    block->y[i] = read<Scalar, kSwap>(bytes + cloud.y);
    block->z[i] = read<Scalar, kSwap>(bytes + cloud.z);
  }
}

// What fills up a block: nothing measured.
template <typename Scalar>
void fill(std::size_t first, std::size_t last, SensorBlock<Scalar>* block) {
  for (std::size_t i = first; i < last; ++i) {
    block->x[i] = block->y[i] = block->z[i] = std::numeric_limits<Scalar>::quiet_NaN();
  }
}

// Not merely so large that its square is.
template <typename Scalar>
std::uint32_t count_infinite(const SensorBlock<Scalar>& block, std::size_t count) {
  std::uint32_t infinite = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_nan = std::isnan(block.x[i]) || std::isnan(block.y[i]) || std::isnan(block.z[i]);
    const bool is_infinite =
        std::isinf(block.x[i]) || std::isinf(block.y[i]) || std::isinf(block.z[i]);
    infinite += static_cast<std::uint32_t>(is_infinite && !is_nan);
  }
  return infinite;
}

// A rectangle of a cloud. Where there are more rows than one, each takes kTileSide slots.
struct Window {
  const std::uint8_t* bytes;
  std::size_t rows, columns;
};

template <typename Scalar, bool kSwap>
std::size_t crop_as(const RawCloud& cloud, const Window& window, const CropParameters& pose,
                    CropBatch* out, IngestCounts* counts) {
  SensorBlock<Scalar> block;
  const std::size_t used = (window.rows - 1) * kTileSide + window.columns;
  for (std::size_t row = 0; row < window.rows; ++row) {
    const std::size_t slot = row * kTileSide;
    load<Scalar, kSwap>(cloud, window.bytes + row * cloud.row_step, window.columns, slot, &block);
    if (row + 1 < window.rows) fill(slot + window.columns, slot + kTileSide, &block);
  }
  fill(used, (used + 7) / 8 * 8, &block);
  CropTally tally;
  if constexpr (std::is_same_v<Scalar, float>) {
    tally = crop_floats(range_of(pose), block.x, block.y, block.z, used, out);
  } else {
    tally = crop_doubles(range_of(pose), block.x, block.y, block.z, used, out);
  }
  const std::size_t never_received = used - window.rows * window.columns;
  counts->not_a_number += static_cast<std::uint32_t>(tally.not_a_number - never_received);
  if (tally.endless > 0) counts->infinite += count_infinite(block, used);
  counts->outside_region += static_cast<std::uint32_t>(tally.beyond);
  return tally.kept;
}

std::size_t crop_window(const RawCloud& cloud, const Window& window, const CropParameters& pose,
                        CropBatch* block, IngestCounts* counts) {
  const auto crop = cloud.is_double
                        ? cloud.swap_bytes ? &crop_as<double, true> : &crop_as<double, false>
                    : cloud.swap_bytes ? &crop_as<float, true>
                                       : &crop_as<float, false>;
  return crop(cloud, window, pose, block, counts);
}

// What became of points of four floats.
// @returns how many are kept; a negative number: to be done the other way
std::ptrdiff_t take(const CropTally& tally, IngestCounts* counts) {
  if (tally.endless > 0) return -1;  // rare; they have to be looked at
  counts->not_a_number += static_cast<std::uint32_t>(tally.not_a_number);
  counts->outside_region += static_cast<std::uint32_t>(tally.beyond);
  return static_cast<std::ptrdiff_t>(tally.kept);
}

const float* floats(const std::uint8_t* bytes) { return reinterpret_cast<const float*>(bytes); }

}  // namespace

std::size_t crop_points(const RawCloud& cloud, std::size_t row, std::size_t column,
                        std::size_t count, const CropParameters& pose, CropBatch* block,
                        IngestCounts* counts) {
  const std::uint8_t* bytes = bytes_of(cloud, row, column);
  if (is_four_floats(cloud) && count % kXyzwStep == 0) {
    const CropTally tally = crop_xyzw(range_of(pose), floats(bytes), count / kXyzwStep, block);
    const std::ptrdiff_t kept = take(tally, counts);
    if (kept >= 0) return static_cast<std::size_t>(kept);
  }
  return crop_window(cloud, {bytes, 1, count}, pose, block, counts);
}

std::size_t crop_tile(const RawCloud& cloud, std::size_t row, std::size_t column,
                      const CropParameters& pose, CropBatch* block, IngestCounts* counts) {
  constexpr std::size_t kSlots = kTileSide * kTileSide;
  const Window window = {bytes_of(cloud, row, column), std::min(kTileSide, cloud.height - row),
                         std::min(kTileSide, cloud.width - column)};
  if (is_four_floats(cloud) && window.rows == kTileSide && window.columns == kTileSide) {
    const CropTally tally =
        crop_xyzw_tile(range_of(pose), floats(window.bytes), cloud.row_step / sizeof(float), block);
    const std::ptrdiff_t kept = take(tally, counts);
    if (kept >= 0) return static_cast<std::size_t>(kept);
  }
  const std::size_t kept = crop_window(cloud, window, pose, block, counts);
  const std::size_t used = (window.rows - 1) * kTileSide + window.columns;
  std::fill(block->x + used, block->x + kSlots, std::numeric_limits<float>::quiet_NaN());
  return kept;
}

}  // namespace ist
