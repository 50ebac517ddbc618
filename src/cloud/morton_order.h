#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace ist {

/// Puts points into Morton order (Z-order): neighbours in the order are mostly neighbours in space.
/// Keeps its scratch memory. Not thread safe.
///
/// The keys have as many bits as the number of points asks for: points lie on surfaces, so n points
/// fill a grid of about sqrt(n) cells a side. Where many share a cell nevertheless (an outlier has
/// stretched the grid, or the cloud is dense in one place), the cell is ordered by a grid of its
/// own. So the order is good at every scale, and the usual cloud costs two passes of a radix sort.
class MortonOrder {
 public:
  /// @param x,y,z  n finite coordinates
  /// @param order  overwritten with a permutation of 0 .. n-1; deterministic
  void sort(const float* x, const float* y, const float* z, std::size_t n,
            std::vector<std::uint32_t>* order);

 private:
  /// What is sorted: the key in the upper half, the point's number in the lower.
  using Record = std::uint64_t;

  void sort_cell(std::size_t first, std::size_t last);
  void refine_crowded_cells(std::size_t first, std::size_t last);
  void radix_sort(std::size_t first, std::size_t last, int key_bits);

  const float *x_ = nullptr, *y_ = nullptr, *z_ = nullptr;
  std::vector<Record> records_, scratch_;
  std::vector<std::uint32_t> histogram_;
};

}  // namespace ist
