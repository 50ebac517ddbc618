#include "cloud/index/point_cells.h"

#include <hwy/cache_control.h>

#include <algorithm>
#include <cmath>

#include "cloud/index/slice_kernel.h"
#include "internal/bvh/prefetch.h"

namespace ist {
namespace {

// Points in a cell, on average, where they lie on a surface.
constexpr double kPointsPerCell = 400.0;

// The bounds of most of a sample along an axis.
template <typename Coordinate>
void find_bounds(CloudPoint* sample, std::size_t count, const Coordinate& of, float* min,
                 float* max) {
  const auto nth = [&](std::size_t n) {
    std::nth_element(sample, sample + n, sample + count,
                     [&of](const CloudPoint& a, const CloudPoint& b) { return of(a) < of(b); });
    return of(sample[n]);
  };
  constexpr std::size_t kOutliers = 32;  // one of so many at either end is ignored
  *min = nth(count / kOutliers);
  *max = nth(count - 1 - count / kOutliers);
}

}  // namespace

void PointCells::start(CloudPoint* sample, std::size_t count, std::size_t n) {
  first_.fill(0);
  end_.fill(0);
  chunks_ = 1;
  size_ = cell_ = taken_ = 0;
  grid_ = PointGrid();
  if (count == 0) return;
  float max[3];
  find_bounds(
      sample, count, [](const CloudPoint& p) { return p.x; }, &grid_.min[0], &max[0]);
  find_bounds(
      sample, count, [](const CloudPoint& p) { return p.y; }, &grid_.min[1], &max[1]);
  find_bounds(
      sample, count, [](const CloudPoint& p) { return p.z; }, &grid_.min[2], &max[2]);
  float extent = 0.0F;
  for (int i = 0; i < 3; ++i) extent = std::max(extent, max[i] - grid_.min[i]);
  constexpr double kMost = 1 << PointGrid::kBits;
  const double side = std::floor(std::sqrt(static_cast<double>(n) / kPointsPerCell));
  const auto cells = static_cast<float>(std::clamp(side, 1.0, kMost));
  const float per_metre = cells / extent;
  if (!std::isfinite(per_metre) || !(per_metre > 0.0F)) return;  // the points coincide, or nearly
  grid_.per_metre = per_metre;
  for (int i = 0; i < 3; ++i) {
    grid_.last[i] = std::min(std::floor((max[i] - grid_.min[i]) * per_metre), cells - 1.0F);
  }
}

void PointCells::add(const CropBatch& batch, std::size_t count, std::uint32_t first_id) {
  scatter(find_cells(grid_, batch, count, first_id, &batch_));
}

void PointCells::add(const CloudPoint* points, std::size_t n) {
  while (n > 0) {
    const std::size_t count = std::min(n, kCropBatch);
    std::copy_n(points, count, batch_.points);
    scatter(find_cells(grid_, count, &batch_));
    points += count;
    n -= count;
  }
}

void PointCells::scatter(std::size_t count) {
  size_ += count;
  CloudPoint* pool = pool_.data();
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t cell = batch_.cells[i] >> 8;
    std::uint32_t end = end_[cell];
    if (end % kChunk == 0) {
      end = next_chunk(cell, end);
      pool = pool_.data();
    }
    hwy::Prefetch(pool + end + 4);  // the next line of four
    pool[end] = batch_.points[batch_.cells[i] & 0xFFU];
    end_[cell] = end + 1;
  }
}

// @param end  of the last chunk, or 0: there is none
// @returns the first point of a new one
std::uint32_t PointCells::next_chunk(std::size_t cell, std::uint32_t end) {
  const std::size_t chunk = chunks_++;
  if (next_.size() < chunks_) {
    next_.resize(2 * chunks_);
    pool_.resize(next_.size() * kChunk + kPointSlack);
  }
  const auto begin = static_cast<std::uint32_t>(chunk * kChunk);
  if (end == 0) {
    first_[cell] = begin;
  } else {
    next_[end / kChunk - 1] = static_cast<std::uint32_t>(chunk);
  }
  return begin;
}

// Advances to the next cell that is not empty and prefetches its first points.
void PointCells::skip_empty() {
  while (taken_ < end_.size() && end_[taken_] == 0) ++taken_;
  if (taken_ == end_.size()) return;
  const std::size_t begin = first_[taken_], end = end_[taken_];
  const std::size_t here = (end - 1) / kChunk == begin / kChunk ? end - begin : kChunk;
  prefetch_lines(&pool_[begin], here * sizeof(CloudPoint));
}

// Reserves as much for every cell as for the fullest one, so that it does not depend on the cells
// that are gathered.
void PointCells::find_largest() {
  largest_ = 0;
  for (cell_ = 0; cell_ < end_.size(); ++cell_) {
    if (end_[cell_] == 0) continue;
    std::size_t count = 0;
    for_each_part([&count](const CloudPoint*, std::size_t n) { count += n; });
    largest_ = std::max(largest_, count);
  }
  if (gathered_.size() < largest_ + kPointSlack) gathered_.resize(2 * (largest_ + kPointSlack));
}

bool PointCells::next() {
  if (taken_ == 0) {
    find_largest();
    skip_empty();
  }
  if (taken_ == end_.size()) return false;
  cell_ = taken_++;
  skip_empty();
  return true;
}

PointCells::Points PointCells::points() {
  const std::size_t begin = first_[cell_], end = end_[cell_];
  if (begin / kChunk == (end - 1) / kChunk) return {&pool_[begin], end - begin};
  std::size_t count = 0;
  for_each_part([&](const CloudPoint* part, std::size_t n) {
    std::copy_n(part, n, &gathered_[count]);
    count += n;
  });
  return {gathered_.data(), count};
}

}  // namespace ist
