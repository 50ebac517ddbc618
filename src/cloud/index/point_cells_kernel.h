#pragma once

#include <cstddef>
#include <cstdint>

#include "cloud/filters/crop.h"
#include "cloud/format/cloud_point.h"

namespace ist {

/// A coarse grid of cubes over most of a cloud. Points outside of it belong to the cells at its
/// sides.
struct PointGrid {
  static constexpr int kBits = 4;  ///< per axis of a cell's number
  static constexpr std::size_t kMostCells = std::size_t{1} << (3 * kBits);

  float min[3] = {0.0F, 0.0F, 0.0F};   ///< [m]
  float per_metre = 0.0F;              ///< one over a cell's edge
  float last[3] = {0.0F, 0.0F, 0.0F};  ///< number of the last cell along each axis
};

/// Some points, and the cells of those to keep: 256 times the cell's number (in Morton order) plus
/// the number of the point.
struct alignas(64) CellBatch {
  CloudPoint points[kCropBatch];
  std::uint32_t cells[kCropBatch + 16];
};

/// Copies a batch of cropped points and finds the cells of those that are not dropped.
/// @param count  used slots
/// @returns how many are kept
std::size_t find_cells(const PointGrid& grid, const CropBatch& crop, std::size_t count,
                       std::uint32_t first_id, CellBatch* batch);

/// Finds the cells of the first `count` points of `batch` itself.
std::size_t find_cells(const PointGrid& grid, std::size_t count, CellBatch* batch);

}  // namespace ist
