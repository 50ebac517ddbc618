// The builder for unorganized clouds: points in any order.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "cloud/index/point_bvh_builder.h"
#include "internal/bvh/padded_box.h"

namespace ist {
namespace {

constexpr std::size_t kEnough = 4 * kTilePoints;  // tiles for well filled nodes
// Points that share a box, at most: a query that looks there looks at all of them.
constexpr std::size_t kMostUnsliced = 4096;

}  // namespace

// Groups the tiles that are in no node yet, when there are enough to fill nodes.
void PointBvhBuilder::end_cell() {
  if (ungrouped_.size() < kEnough) return;
  hierarchy_.append_nodes(ungrouped_, &bvh_->nodes_);
  ungrouped_.clear();
  group_begin_ = 0;
}

// Visits the slices into which the last sort divides the points: as many as the square root of the
// number of parts, each of whole parts. Where the sort has a dense slice, whose points it does not
// order, there are three: the points before it, its own, and those after it.
template <typename Visit>
void PointBvhBuilder::for_each_slice(std::size_t n, std::size_t part, const Visit& visit) const {
  const std::size_t dense_begin = slicer_.dense_begin(), dense_end = slicer_.dense_end();
  if (dense_end > 0) {
    if (dense_begin > 0) visit(std::size_t{0}, dense_begin);
    visit(dense_begin, dense_end);
    if (dense_end < n) visit(dense_end, n);
    return;
  }
  constexpr std::size_t kAllAtOnce = 4;
  const std::size_t parts = (n + part - 1) / part;
  const auto root = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(parts))));
  const std::size_t slices = part == kTilePoints || parts > kAllAtOnce ? root : parts;
  for (std::size_t i = 0; i < slices; ++i) {
    visit(parts * i / slices * part, std::min(parts * (i + 1) / slices * part, n));
  }
}

// Adds points in the order in which they come.
// @param box  of all of them
void PointBvhBuilder::add_unsliced(const CloudPoint* points, std::size_t n, const PaddedBox& box) {
  PointTile* tiles = next_tiles((n + kTilePoints - 1) / kTilePoints);
  for (std::size_t count = fill_tiles(points, n, tiles); count > 0; --count) {
    bvh_->size_ += static_cast<std::size_t>(bvh_->tiles_[used_].count);
    ungrouped_.push_back({box, ~static_cast<std::int32_t>(used_)});
    ++used_;
    if (ungrouped_.size() - group_begin_ == kTilePoints) end_group();
  }
}

// Adds points of a distant cell: sliced only until no part has too many.
// @param spare  buffer for n points
void PointBvhBuilder::add_distant_points(CloudPoint* points, CloudPoint* spare, std::size_t n) {
  if (n <= kMostUnsliced || !slicer_.sort(points, n, spare)) {
    if (n > 0) add_unsliced(points, n, box_of(points, n));
    end_group();
    return;
  }
  for_each_slice(n, kMostUnsliced, [&](std::size_t begin, std::size_t end) {
    add_distant_points(spare + begin, points + begin, end - begin);
  });
}

// Adds the points of the cell where it is distant. @returns whether it is
bool PointBvhBuilder::add_if_distant(const BoxFilter& is_distant) {
  if (!is_distant) return false;
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  PaddedBox box = {{kInfinity, kInfinity, kInfinity, 0.0F},
                   {-kInfinity, -kInfinity, -kInfinity, 0.0F}};
  std::size_t count = 0;
  cells_.for_each_part([&](const CloudPoint* points, std::size_t n) {
    box.extend(box_of(points, n));
    count += n;
  });
  if (!is_distant(box)) return false;
  if (count > kMostUnsliced) {
    const PointCells::Points cell = cells_.points();
    add_distant_points(cell.points, spare_.data(), cell.size);
    return true;
  }
  cells_.for_each_part(
      [&](const CloudPoint* points, std::size_t n) { add_unsliced(points, n, box); });
  end_group();
  return true;
}

// Adds the points of a cell: slices them until the parts fit a batch.
// @param spare  buffer for n points
void PointBvhBuilder::add_points(CloudPoint* points, CloudPoint* spare, std::size_t n,
                                 const Filters& filters) {
  if (n <= TileBatch::kMost) {
    batch_.tiles = next_tiles(n);
    batch_.count = 0;
    if (n > 0) slice_into_tiles(points, spare, n);
    add_batch(filters);
    return;
  }
  if (!slicer_.sort(points, n, spare)) std::copy_n(points, n, spare);
  for_each_slice(n, TileBatch::kMost, [&](std::size_t begin, std::size_t end) {
    add_points(spare + begin, points + begin, end - begin, filters);
  });
}

// Slices the points of a batch until sixteen consecutive ones are a tile.
void PointBvhBuilder::slice_into_tiles(CloudPoint* points, CloudPoint* spare, std::size_t n) {
  if (n <= kTilePoints || !slicer_.sort(points, n, spare)) {
    make_tiles(points, n, &batch_);
    return;
  }
  // Sixteen consecutive points are at least half as long as they are wide: a slice across the other
  // side is not needed.
  constexpr std::size_t kFewTiles = 4;
  constexpr float kWidest = 2.0F;
  const BoxShape& shape = slicer_.shape();
  const float width = shape.second * static_cast<float>(n) / static_cast<float>(kTilePoints);
  const bool is_narrow = n <= kFewTiles * kTilePoints || width <= kWidest * shape.longest;
  if (is_narrow && slicer_.dense_end() == 0) {
    make_tiles(spare, n, &batch_);
  } else {
    for_each_slice(n, kTilePoints, [&](std::size_t begin, std::size_t end) {
      slice_into_tiles(spare + begin, points + begin, end - begin);
    });
  }
}

// Adds the tiles of the batch, filtered where a filter may drop points.
void PointBvhBuilder::add_batch(const Filters& filters) {
  const std::size_t count = batch_.count;
  const PointTile* tiles = batch_.tiles;
  bool is_clear = true;
  for (std::size_t i = 0; i < count; i += kTilePoints) {
    BoxNode& boxes = batch_.boxes[i / kTilePoints];
    boxes.count = static_cast<std::int32_t>(std::min(count - i, kTilePoints));
    is_clear = is_clear && !may_drop_any(filters, bounds_of(boxes));
  }
  if (!is_clear) {
    filtered_.assign(tiles, tiles + count);
  }
  // Splits may have made more tiles than fit whole nodes: groups of about equal size.
  const std::size_t nodes = (count + kTilePoints - 1) / kTilePoints,
                    each = (count + nodes - 1) / nodes;
  for (std::size_t begin = 0; begin < count; begin += each) {
    const std::size_t end = std::min(begin + each, count);
    if (is_clear) {
      add_clear_tiles(begin, end);
    } else {
      add_filtered_tiles(begin, end, filters);
    }
    end_group();
  }
}

void PointBvhBuilder::add_clear_tiles(std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end;) {
    const std::size_t slot = i % kTilePoints, here = std::min(kTilePoints - slot, end - i);
    const auto which = static_cast<std::uint32_t>(((std::size_t{1} << here) - 1) << slot);
    add_loaded_tiles(batch_.boxes[i / kTilePoints], which);
    i += here;
  }
}

// Tiles that the filter empties move all that follow.
void PointBvhBuilder::add_filtered_tiles(std::size_t begin, std::size_t end,
                                         const Filters& filters) {
  static const PointFilter kDropNone;
  const auto box_of_tile = [this](std::size_t i) {
    return box_in(batch_.boxes[i / kTilePoints], static_cast<int>(i % kTilePoints));
  };
  PaddedBox all = box_of_tile(begin);
  for (std::size_t i = begin + 1; i < end; ++i) all.extend(box_of_tile(i));
  const bool is_clear = !may_drop_any(filters, all);
  for (std::size_t i = begin; i < end; ++i) {
    *next_tiles(1) = filtered_[i];
    add_tile(box_of_tile(i), is_clear ? kDropNone : filters.drop);
  }
}

bool PointBvhBuilder::may_drop_any(const Filters& filters, const PaddedBox& box) {
  return filters.drop && (!filters.may_drop || filters.may_drop(box));
}

void PointBvhBuilder::build(const Eigen::Isometry3d& X_FO, const CloudPoint* points, std::size_t n,
                            const PointFilter& drop, PointBvh* bvh) {
  std::array<CloudPoint, PointCells::kSample> sample;
  const std::size_t stride = n / sample.size() | 1U;
  std::size_t count = 0;
  for (std::size_t i = 0; i < n && count < sample.size(); i += stride) sample[count++] = points[i];
  cells_.start(sample.data(), count, n);
  cells_.add(points, n);
  build_from_cells(X_FO, drop, {}, {}, bvh);
}

// Allocates far more than needed: the numbers of nodes and tiles differ from cloud to cloud of a
// stream, and memory is to be allocated once.
void PointBvhBuilder::reserve() {
  const std::size_t nodes = cells_.size() / (4 * kTilePoints) + kTilePoints;
  if (bvh_->nodes_.capacity() < nodes) bvh_->nodes_.reserve(2 * nodes);
  const std::size_t tiles =
      2 * cells_.size() / kTilePoints + kTilePoints;  // pages are taken when written
  if (bvh_->tiles_.capacity() < tiles) {
    bvh_->tiles_.clear();
    bvh_->tiles_.reserve(tiles + tiles / 2);
    bvh_->first_pixel_.clear();
    bvh_->first_pixel_.reserve(tiles + tiles / 2);
  }
  ungrouped_.reserve(kEnough + TileBatch::kMost);
  if (spare_.size() < cells_.largest() + kPointSlack) {
    spare_.resize(2 * (cells_.largest() + kPointSlack));
  }
  slicer_.reserve(cells_.largest());
  filtered_.reserve(TileBatch::kMost);
}

void PointBvhBuilder::build_from_cells(const Eigen::Isometry3d& X_FO, const PointFilter& drop,
                                       const BoxFilter& may_drop, const BoxFilter& is_distant,
                                       PointBvh* bvh) {
  start(X_FO, bvh);
  bool is_first = true;
  while (cells_.next()) {
    if (std::exchange(is_first, false)) reserve();
    if (!add_if_distant(is_distant)) {
      const PointCells::Points cell = cells_.points();
      add_points(cell.points, spare_.data(), cell.size, {drop, may_drop});
    }
    end_cell();
  }
  finish();
}

}  // namespace ist
