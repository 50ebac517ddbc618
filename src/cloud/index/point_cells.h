#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "cloud/format/cloud_point.h"
#include "cloud/index/point_cells_kernel.h"

namespace ist {

/// Brings together, in one pass, points that come in any order: by the cells of a coarse grid.
/// Keeps its memory. Not thread safe.
///
/// Each cell has a list of chunks, so that nothing is counted beforehand and each point is written
/// once. The grid is laid over a sample: what lies beyond comes into the cells at its sides, which
/// costs time but never an answer.
class PointCells {
 public:
  /// Points that a sample has at most.
  static constexpr std::size_t kSample = 256;

  /// Forgets all points.
  /// @param sample  some of the points to come, `count` of them at most kSample; overwritten
  /// @param n       about how many are to come
  void start(CloudPoint* sample, std::size_t count, std::size_t n);

  /// @param count     used slots of the block
  /// @param first_id  of its first point; the others' follow
  void add(const CropBlock& block, std::size_t count, std::uint32_t first_id);
  void add(const CloudPoint* points, std::size_t n);

  /// Points that were added.
  std::size_t size() const { return size_; }

  /// Points of one cell, in the order in which they were added.
  struct Cell {
    CloudPoint* points;
    std::size_t size;
  };
  /// Hands out cell after cell; neighbours in this order are mostly neighbours in space (Morton
  /// order). A cell is good until the next call; it may be overwritten, and kPointSlack points more
  /// may be read.
  /// @returns the next cell that is not empty; an empty one when there is none left
  Cell next();

 private:
  static constexpr std::size_t kChunk = 128;

  void scatter(std::size_t count);
  std::uint32_t next_chunk(std::size_t cell, std::uint32_t end);
  void skip_empty();

  PointGrid grid_;
  CellBlock block_;
  std::array<std::uint32_t, PointGrid::kMostCells> first_{}, end_{};  ///< points in pool_, or 0
  std::vector<CloudPoint> pool_;
  std::vector<std::uint32_t> next_;  ///< chunk after a chunk
  std::vector<CloudPoint> cell_;     ///< of more than one chunk
  std::size_t size_ = 0;
  std::size_t taken_ = 0;   ///< cells that next() is done with
  std::size_t chunks_ = 1;  ///< in use; the first one stays empty
};

}  // namespace ist
