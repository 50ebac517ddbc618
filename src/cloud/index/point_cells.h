#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/format/cloud_point.h"
#include "cloud/index/point_cells_kernel.h"

namespace ist {

/// Sorts points that come in any order into the cells of a coarse grid, in one pass. Keeps its
/// memory. Not thread safe.
///
/// Each cell has a list of chunks, so that nothing is counted beforehand and each point is written
/// once. The grid is laid over a sample of the points; points outside of it belong to the cells at
/// its sides, which costs time but changes no answer.
class PointCells {
 public:
  /// Largest sample.
  static constexpr std::size_t kSample = 256;

  /// Removes all points and lays a new grid.
  /// @param sample  some of the points to come, `count` of them at most kSample; overwritten
  /// @param n       about how many are to come
  void start(CloudPoint* sample, std::size_t count, std::size_t n);

  /// @param count     used slots of the batch
  /// @param first_id  of its first point; the others' follow
  void add(const CropBatch& batch, std::size_t count, std::uint32_t first_id);
  void add(const CloudPoint* points, std::size_t n);

  /// Number of points added.
  std::size_t size() const { return size_; }

  /// Visits one point of each cell that is not empty.
  template <typename Visit>
  void for_each_first(const Visit& visit) const {
    for (std::size_t i = 0; i < end_.size(); ++i) {
      if (end_[i] != 0) visit(pool_[first_[i]]);
    }
  }

  /// Some points of a cell.
  struct Points {
    CloudPoint* points;
    std::size_t size;
  };
  /// Points in the fullest cell, as soon as next() was called.
  std::size_t largest() const { return largest_; }
  /// Goes to the next cell that is not empty, in Morton order: neighbours in this order are mostly
  /// neighbours in space. @returns false after the last one
  bool next();
  /// Visits the points of the cell, part by part, in the order in which they were added.
  /// kPointSlack points after a part may be read.
  template <typename Visit>
  void for_each_part(const Visit& visit) const {
    const std::size_t end = end_[cell_], last = (end - 1) / kChunk;
    for (std::size_t chunk = first_[cell_] / kChunk;; chunk = next_[chunk]) {
      const std::size_t begin = chunk * kChunk;
      visit(&pool_[begin], chunk == last ? end - begin : kChunk);
      if (chunk == last) return;
    }
  }
  /// All points of the cell in one array, in the order in which they were added. Valid until the
  /// next call; may be overwritten, and kPointSlack points after it may be read.
  Points points();

 private:
  static constexpr std::size_t kChunk = 128;

  void scatter(std::size_t count);
  std::uint32_t next_chunk(std::size_t cell, std::uint32_t end);
  void skip_empty();
  void find_largest();

  PointGrid grid_;
  CellBatch batch_;
  std::array<std::uint32_t, PointGrid::kMostCells> first_{}, end_{};  ///< points in pool_, or 0
  std::vector<CloudPoint> pool_;
  std::vector<std::uint32_t> next_;   ///< by chunk: the next one of its cell
  std::vector<CloudPoint> gathered_;  ///< buffer for a cell of more than one chunk
  std::size_t size_ = 0, largest_ = 0;
  std::size_t cell_ = 0;    ///< that next() has gone to
  std::size_t taken_ = 0;   ///< cells that next() has gone to or skipped
  std::size_t chunks_ = 1;  ///< in use; the first one stays empty
};

}  // namespace ist
