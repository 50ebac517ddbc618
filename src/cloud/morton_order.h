#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <vector>

namespace ist {

/// A point on its way into an index; it fits one SIMD register.
struct alignas(16) CloudPoint {
  float x, y, z;     ///< [m] from the index's origin
  std::uint32_t id;  ///< carried through to the answers
};

/// Puts points into Morton order (Z-order): neighbours in the order are mostly neighbours in space.
/// Keeps its scratch memory. Not thread safe.
///
/// The points themselves are sorted, digit by digit from the top: first by a coarse grid over all
/// of them, then each of its cells, which fits the first-level cache, by a grid over the points
/// that are in it, as fine as their number asks for (points lie on surfaces, so n of them fill a
/// grid of about sqrt(n) cells a side); and so on where many share a cell nevertheless. So the
/// order is good at every scale, and an outlier that stretches a grid costs one more digit.
class MortonOrder {
 public:
  /// @param points  n of them, finite
  /// @returns them in an order that depends on nothing but them; valid until the next call
  const CloudPoint* sort(const CloudPoint* points, std::size_t n);

  /// Cells of the coarsest grid: where each ends in the order, ascending; the last one ends at n.
  const std::vector<std::size_t>& cell_ends() const { return cell_ends_; }

 private:
  /// Sorts by one digit. @returns where each cell ends, by cell; empty: there is nothing to order
  const std::vector<std::uint32_t>& pass(const CloudPoint* from, std::size_t n, CloudPoint* to);
  void sort_cells(const std::vector<std::uint32_t>& ends, CloudPoint* points);

  std::vector<CloudPoint> sorted_;
  std::vector<CloudPoint> cell_;                 ///< copy of the one in work
  std::vector<std::uint16_t> keys_;              ///< by point
  std::deque<std::vector<std::uint32_t>> ends_;  ///< by depth
  std::size_t depth_ = 0;
  std::vector<std::size_t> cell_ends_;
};

}  // namespace ist
