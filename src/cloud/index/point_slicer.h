#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/format/cloud_point.h"
#include "cloud/index/divide_kernel.h"

namespace ist {

/// Divides points into parts that lie side by side, of equal size, across the longest side of their
/// box, by a counting sort. Keeps its memory. Not thread safe.
class PointSlicer {
 public:
  /// Sorts points.
  /// @param from  n of them, and room for kPointSlack more
  /// @param to    n of them, overwritten unless false is returned
  /// @returns false: the points are one, or as good as one, and in any order
  bool sort(const CloudPoint* from, std::size_t n, CloudPoint* to);

  /// Of what was sorted last.
  const BoxShape& shape() const { return shape_; }
  /// Of what was sorted last: points too many for that order lie between these two, as close
  /// together as makes no difference for it; as where a few lie far away. Empty, as a rule.
  std::size_t crowd_begin() const { return crowd_begin_; }
  std::size_t crowd_end() const { return crowd_end_; }

 private:
  static constexpr std::size_t kMostSlices = 128;

  std::vector<std::int32_t> slices_;  ///< by point
  std::array<std::uint32_t, kMostSlices> at_;
  BoxShape shape_;
  std::size_t crowd_begin_ = 0, crowd_end_ = 0;
};

}  // namespace ist
