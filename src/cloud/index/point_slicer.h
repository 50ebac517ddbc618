#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/format/cloud_point.h"
#include "cloud/index/slice_kernel.h"

namespace ist {

/// Orders points along the longest side of their box, by a counting sort over slices of equal
/// width. Keeps its memory. Not thread safe.
class PointSlicer {
 public:
  /// Allocates for n points, where that is not enough.
  void reserve(std::size_t n);
  /// Sorts points.
  /// @param from  n of them, and kPointSlack more that may be read
  /// @param to    n of them, overwritten unless false is returned
  /// @returns false: the points coincide, or nearly, and are in any order
  bool sort(const CloudPoint* from, std::size_t n, CloudPoint* to);

  /// The box of the points that were sorted last.
  const BoxShape& shape() const { return shape_; }
  /// The dense slice of the last sort: a slice with more than a quarter of all points, which are in
  /// no order among themselves, as where a few points lie far from all others. Usually there is
  /// none, and both are 0.
  std::size_t dense_begin() const { return dense_begin_; }
  std::size_t dense_end() const { return dense_end_; }

 private:
  static constexpr std::size_t kMostSlices = 128;

  std::vector<std::int32_t> slices_;  ///< by point
  std::array<std::uint32_t, kMostSlices> at_;
  BoxShape shape_;
  std::size_t dense_begin_ = 0, dense_end_ = 0;
};

}  // namespace ist
