#include "cloud/filters/crop.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "cloud/filters/crop_kernel.h"
#include "cloud/format/point_reader.h"

namespace ist {
namespace {

CropKernelParameters kernel_parameters(const CropParameters& crop) {
  CropKernelParameters parameters;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      parameters.R[3 * row + column] = crop.X_OS.linear()(row, column);
    }
    parameters.t[row] = crop.X_OS.translation()[row];
  }
  parameters.min_range_sq = crop.min_range_sq;
  parameters.max_range_sq = crop.max_range_sq;
  parameters.believed_sq = crop.believed_sq;
  for (int axis = 0; axis < 3; ++axis) parameters.region_center[axis] = crop.region_center[axis];
  parameters.region_radius_sq = crop.region_radius_sq;
  return parameters;
}

// Coordinates of a batch as they are read, in the sensor frame [m].
template <typename Scalar>
struct alignas(64) SensorBatch {
  Scalar x[kCropBatch], y[kCropBatch], z[kCropBatch];
};

// Whether points are four floats each, as most drivers write them.
bool is_four_floats(const RawCloud& cloud) {
  return cloud.depth == DepthType::kNone && !cloud.is_double && !cloud.swap_bytes &&
         cloud.point_step == 4 * sizeof(float) && cloud.x == 0 && cloud.y == sizeof(float) &&
         cloud.z == 2 * sizeof(float) &&
         reinterpret_cast<std::uintptr_t>(cloud.data) % sizeof(float) == 0 &&
         cloud.row_step % sizeof(float) == 0;
}

// Neighbouring points of a row.
struct RowPart {
  std::size_t row, column, count;
};

// Reads some points of a row into slots from `slot` on.
template <typename Scalar, bool kSwap>
void load(const RawCloud& cloud, const RowPart& part, std::size_t slot,
          SensorBatch<Scalar>* batch) {
  const std::uint8_t* bytes = bytes_of(cloud, part.row, part.column);
  for (std::size_t i = slot; i < slot + part.count; ++i, bytes += cloud.point_step) {
    batch->x[i] = read<Scalar, kSwap>(bytes + cloud.x);
    batch->y[i] = read<Scalar, kSwap>(bytes + cloud.y);
    batch->z[i] = read<Scalar, kSwap>(bytes + cloud.z);
  }
}

// The same for the pixels of a depth image.
void load_depth(const RawCloud& image, const RowPart& part, std::size_t slot,
                SensorBatch<double>* batch) {
  read_depth_pixels(image, part.row, part.column, part.count, batch->x + slot, batch->y + slot,
                    batch->z + slot);
}

// Fills slots with NaN, as if nothing was measured.
template <typename Scalar>
void fill(std::size_t first, std::size_t last, SensorBatch<Scalar>* batch) {
  for (std::size_t i = first; i < last; ++i) {
    batch->x[i] = batch->y[i] = batch->z[i] = std::numeric_limits<Scalar>::quiet_NaN();
  }
}

// Points with an infinite coordinate and none that is NaN; not those of which only the squared
// range is infinite.
template <typename Scalar>
std::uint32_t count_infinite(const SensorBatch<Scalar>& batch, std::size_t count) {
  std::uint32_t infinite = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool is_nan = std::isnan(batch.x[i]) || std::isnan(batch.y[i]) || std::isnan(batch.z[i]);
    const bool is_infinite =
        std::isinf(batch.x[i]) || std::isinf(batch.y[i]) || std::isinf(batch.z[i]);
    infinite += static_cast<std::uint32_t>(is_infinite && !is_nan);
  }
  return infinite;
}

void add(const CropTally& tally, IngestCounts* counts) {
  counts->not_a_number += static_cast<std::uint32_t>(tally.not_a_number);
  counts->outside_region += static_cast<std::uint32_t>(tally.outside_region);
  counts->too_near += static_cast<std::uint32_t>(tally.too_near);
  counts->not_believed += static_cast<std::uint32_t>(tally.not_believed);
}

// A rectangle of a cloud. Where it has several rows, each takes kTileSide slots.
struct Window {
  std::size_t row, column;  // of the first point
  std::size_t rows, columns;
};

template <typename Scalar,
          void (*kLoad)(const RawCloud&, const RowPart&, std::size_t, SensorBatch<Scalar>*)>
std::size_t crop_as(const RawCloud& cloud, const Window& window, const CropParameters& crop,
                    CropBatch* out, IngestCounts* counts) {
  SensorBatch<Scalar> batch;
  const std::size_t used = (window.rows - 1) * kTileSide + window.columns;
  for (std::size_t row = 0; row < window.rows; ++row) {
    const std::size_t slot = row * kTileSide;
    kLoad(cloud, {window.row + row, window.column, window.columns}, slot, &batch);
    if (row + 1 < window.rows) fill(slot + window.columns, slot + kTileSide, &batch);
  }
  fill(used, (used + 7) / 8 * 8, &batch);
  CropTally tally;
  if constexpr (std::is_same_v<Scalar, float>) {
    tally = crop_floats(kernel_parameters(crop), batch.x, batch.y, batch.z, used, out);
  } else {
    tally = crop_doubles(kernel_parameters(crop), batch.x, batch.y, batch.z, used, out);
  }
  const std::size_t never_received = used - window.rows * window.columns;
  const std::uint32_t infinite = tally.infinite_square > 0 ? count_infinite(batch, used) : 0;
  add(tally, counts);
  counts->not_a_number -= static_cast<std::uint32_t>(never_received);
  counts->infinite += infinite;
  counts->not_believed -= infinite;
  return tally.kept;
}

std::size_t crop_window(const RawCloud& cloud, const Window& window, const CropParameters& crop,
                        CropBatch* batch, IngestCounts* counts) {
  if (cloud.depth != DepthType::kNone) {
    return crop_as<double, &load_depth>(cloud, window, crop, batch, counts);
  }
  const bool swap = cloud.swap_bytes;
  const auto function = cloud.is_double ? swap ? &crop_as<double, &load<double, true>>
                                               : &crop_as<double, &load<double, false>>
                        : swap ? &crop_as<float, &load<float, true>>
                                        : &crop_as<float, &load<float, false>>;
  return function(cloud, window, crop, batch, counts);
}

// Counts the points of a batch of four floats each.
// @returns how many are kept; negative: some squared range is infinite (rare), nothing is counted,
// and the points have to be read one by one
std::ptrdiff_t add_counts(const CropTally& tally, IngestCounts* counts) {
  if (tally.infinite_square > 0) return -1;
  add(tally, counts);
  return static_cast<std::ptrdiff_t>(tally.kept);
}

const float* floats(const std::uint8_t* bytes) { return reinterpret_cast<const float*>(bytes); }

}  // namespace

std::size_t crop_points(const RawCloud& cloud, std::size_t row, std::size_t column,
                        std::size_t count, const CropParameters& crop, CropBatch* batch,
                        IngestCounts* counts) {
  const std::uint8_t* bytes = bytes_of(cloud, row, column);
  if (is_four_floats(cloud) && count % kXyzwStep == 0) {
    const CropTally tally =
        crop_xyzw(kernel_parameters(crop), floats(bytes), count / kXyzwStep, batch);
    const std::ptrdiff_t kept = add_counts(tally, counts);
    if (kept >= 0) return static_cast<std::size_t>(kept);
  }
  return crop_window(cloud, {row, column, 1, count}, crop, batch, counts);
}

std::size_t crop_tile(const RawCloud& cloud, std::size_t row, std::size_t column,
                      const CropParameters& crop, CropBatch* batch, IngestCounts* counts) {
  constexpr std::size_t kSlots = kTileSide * kTileSide;
  const Window window = {row, column, std::min(kTileSide, cloud.height - row),
                         std::min(kTileSide, cloud.width - column)};
  if (is_four_floats(cloud) && window.rows == kTileSide && window.columns == kTileSide) {
    const CropTally tally =
        crop_xyzw_tile(kernel_parameters(crop), floats(bytes_of(cloud, row, column)),
                       cloud.row_step / sizeof(float), batch);
    const std::ptrdiff_t kept = add_counts(tally, counts);
    if (kept >= 0) return static_cast<std::size_t>(kept);
  }
  const std::size_t kept = crop_window(cloud, window, crop, batch, counts);
  const std::size_t used = (window.rows - 1) * kTileSide + window.columns;
  std::fill(batch->x + used, batch->x + kSlots, std::numeric_limits<float>::quiet_NaN());
  return kept;
}

void move_tile(const RawCloud& cloud, std::size_t row, std::size_t column,
               const Eigen::Isometry3d& X_OS, float* x, float* y, float* z) {
  if (is_four_floats(cloud)) {
    const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> R = X_OS.linear();
    move_xyzw_tile(R.data(), X_OS.translation().data(), floats(bytes_of(cloud, row, column)),
                   cloud.row_step / sizeof(float), x, y, z);
    return;
  }
  constexpr std::size_t kSlots = kTileSide * kTileSide;
  CropParameters crop;
  crop.X_OS = X_OS;
  crop.max_range_sq = std::numeric_limits<double>::max();
  CropBatch batch;
  IngestCounts unused;
  const std::size_t kept = crop_tile(cloud, row, column, crop, &batch, &unused);
  assert(kept == kSlots);
  static_cast<void>(kept);
  std::copy_n(batch.x, kSlots, x);
  std::copy_n(batch.y, kSlots, y);
  std::copy_n(batch.z, kSlots, z);
}

}  // namespace ist
