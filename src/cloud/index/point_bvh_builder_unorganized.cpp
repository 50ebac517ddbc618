// Points that are brought together before they become tiles: lists, of any order or in order.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "cloud/index/point_bvh_builder.h"
#include "cloud/index/tile_box.h"

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::size_t>(kPointWidth);
constexpr std::size_t kEnough = 4 * kWidth;  // tiles, to make nodes of them

// The box of the slots that `mask` leaves: -inf where a slot belongs, inf where not.
PaddedBox box_of(const PointTile& tile, const Lanes& mask) {
  const LaneMap x(tile.x), y(tile.y), z(tile.z);
  return {{x.max(mask).minCoeff(), y.max(mask).minCoeff(), z.max(mask).minCoeff(), 0.0F},
          {x.min(-mask).maxCoeff(), y.min(-mask).maxCoeff(), z.min(-mask).maxCoeff(), 0.0F}};
}

// The mask of the first `count` slots; negated, of the others.
Lanes mask_of_first(std::int32_t count) {
  constexpr float kIn = -std::numeric_limits<float>::infinity(), kOut = -kIn;
  static constexpr float kMasks[2 * kPointWidth] = {kIn,  kIn,  kIn,  kIn,  kIn,  kIn,  kIn,  kIn,
                                                    kIn,  kIn,  kIn,  kIn,  kIn,  kIn,  kIn,  kIn,
                                                    kOut, kOut, kOut, kOut, kOut, kOut, kOut, kOut,
                                                    kOut, kOut, kOut, kOut, kOut, kOut, kOut, kOut};
  return LaneMap(kMasks + kPointWidth - count);
}

// The longest step between neighbours.
struct Leap {
  std::int32_t to;  // the point after it
  float length_sq;  // [m^2]
};

Leap longest_leap(const PointTile& tile) {
  // Fifteen steps, in two overlapping halves.
  constexpr int kHalf = kPointWidth / 2;
  using Half = Eigen::Array<float, kHalf, 1>;
  using HalfMap = Eigen::Map<const Half>;
  const auto squared_steps = [&tile](int first) {
    const auto along = [first](const float* v) {
      return Half((HalfMap(v + first + 1) - HalfMap(v + first)).square());
    };
    return Half(along(tile.x) + along(tile.y) + along(tile.z));
  };
  const Half front = squared_steps(0), back = squared_steps(kHalf - 1);
  const float front_longest = front.maxCoeff(), back_longest = back.maxCoeff();
  const bool in_front = front_longest >= back_longest;
  const Half& half = in_front ? front : back;
  const float longest = in_front ? front_longest : back_longest;
  int k = 0;
  while (k < kHalf - 1 && half[k] != longest) ++k;
  return {k + (in_front ? 1 : kHalf), longest};
}

// Shortens a tile until no leap is worth a cut; gives its box.
PaddedBox cut(PointTile* tile) {
  PaddedBox box = box_of(*tile);
  while (tile->count > 1) {
    // The whole is no longer than both parts and the leap together: a short leap is not worth it.
    constexpr float kShort = 0.99F * (1.0F - kCutBelow);
    const Leap leap = longest_leap(*tile);
    if (leap.length_sq < kShort * kShort * box.diagonal_sq()) break;
    const Lanes mask = mask_of_first(leap.to);
    const PaddedBox front_box = box_of(*tile, mask), back_box = box_of(*tile, -mask);
    if (!is_worth_a_cut(front_box, back_box, box)) break;
    tile->count = leap.to;
    repeat_last(tile);
    box = front_box;
  }
  return box;
}

}  // namespace

// Runs of sixteen, cut where the order leaps.
void PointBvhBuilder::add_runs(const CloudPoint* points, std::size_t n, const PointFilter& drop) {
  while (n > 0) {
    PointTile& tile = *room(1);
    const std::size_t count = std::min(kWidth, n);
    for (std::size_t k = 0; k < count; ++k) {
      tile.x[k] = points[k].x;
      tile.y[k] = points[k].y;
      tile.z[k] = points[k].z;
      tile.id[k] = points[k].id;
    }
    tile.count = static_cast<std::int32_t>(count);
    repeat_last(&tile);
    const PaddedBox box = cut(&tile);
    points += tile.count;
    n -= static_cast<std::size_t>(tile.count);
    keep(box, drop);
  }
}

// Nodes over the tiles that have none yet, when there are enough to fill them.
void PointBvhBuilder::end_cell() {
  if (loose_.size() < kEnough) return;
  hierarchy_.append_nodes(loose_, &index_->nodes_);
  loose_.clear();
  neighbours_ = 0;
}

// The slices that the last sort is good for: as many as the square root of the number of parts,
// each of whole parts; around points that it does not order, those before, they, and those after.
template <typename Visit>
void PointBvhBuilder::for_each_slice(std::size_t n, std::size_t part, const Visit& visit) const {
  const std::size_t crowd = slicer_.crowd_begin(), crowd_end = slicer_.crowd_end();
  if (crowd_end > 0) {
    if (crowd > 0) visit(std::size_t{0}, crowd);
    visit(crowd, crowd_end);
    if (crowd_end < n) visit(crowd_end, n);
    return;
  }
  constexpr std::size_t kAllAtOnce = 4;
  const std::size_t parts = (n + part - 1) / part;
  const auto root = static_cast<std::size_t>(std::lround(std::sqrt(static_cast<double>(parts))));
  const std::size_t slices = part == kWidth || parts > kAllAtOnce ? root : parts;
  for (std::size_t i = 0; i < slices; ++i) {
    visit(parts * i / slices * part, std::min(parts * (i + 1) / slices * part, n));
  }
}

// Points of a cell: sliced until the parts are what is worked on at a time.
void PointBvhBuilder::add_points(CloudPoint* points, CloudPoint* spare, std::size_t n,
                                 const Filters& filters) {
  if (n <= TileBatch::kMost) {
    batch_.tiles = room(n);
    batch_.count = 0;
    if (n > 0) add_part(points, spare, n);
    keep_batch(filters);
    return;
  }
  if (!slicer_.sort(points, n, spare)) std::copy_n(points, n, spare);
  for_each_slice(n, TileBatch::kMost, [&](std::size_t begin, std::size_t end) {
    add_points(spare + begin, points + begin, end - begin, filters);
  });
}

// Sliced until runs of sixteen are tiles.
void PointBvhBuilder::add_part(CloudPoint* points, CloudPoint* spare, std::size_t n) {
  if (n <= kWidth || !slicer_.sort(points, n, spare)) {
    make_tiles(points, n, &batch_);
    return;
  }
  // Runs of sixteen are as long as they are wide, or half as long: no need to slice the other way.
  constexpr std::size_t kFewTiles = 4;
  constexpr float kWidest = 2.0F;
  const BoxShape& shape = slicer_.shape();
  const float width = shape.second * static_cast<float>(n) / static_cast<float>(kWidth);
  const bool is_narrow = n <= kFewTiles * kWidth || width <= kWidest * shape.longest;
  if (is_narrow && slicer_.crowd_end() == 0) {
    make_tiles(spare, n, &batch_);
  } else {
    for_each_slice(n, kWidth, [&](std::size_t begin, std::size_t end) {
      add_part(spare + begin, points + begin, end - begin);
    });
  }
}

// What make_tiles has made becomes part of the index.
void PointBvhBuilder::keep_batch(const Filters& filters) {
  const std::size_t count = batch_.count;
  const PointTile* tiles = batch_.tiles;
  bool is_clear = true;
  for (std::size_t i = 0; i < count; i += kWidth) {
    BoxNode& boxes = batch_.boxes[i / kWidth];
    boxes.count = static_cast<std::int32_t>(std::min(count - i, kWidth));
    if (filters.drop && (!filters.may_drop || filters.may_drop(bounds_of(boxes)))) is_clear = false;
  }
  if (!is_clear) {
    filtered_.reserve(TileBatch::kMost);
    filtered_.assign(tiles, tiles + count);
  }
  // Gaps have made more tiles than fit a node: as many nodes as it takes, alike in size.
  const std::size_t nodes = (count + kWidth - 1) / kWidth, each = (count + nodes - 1) / nodes;
  for (std::size_t begin = 0; begin < count; begin += each) {
    const std::size_t end = std::min(begin + each, count);
    if (is_clear) {
      keep_made(begin, end);
    } else {
      keep_filtered(begin, end, filters.drop);
    }
    end_neighbours();
  }
}

void PointBvhBuilder::keep_made(std::size_t begin, std::size_t end) {
  for (std::size_t i = begin; i < end;) {
    const std::size_t slot = i % kWidth, here = std::min(kWidth - slot, end - i);
    const auto which = static_cast<std::uint32_t>(((std::size_t{1} << here) - 1) << slot);
    keep_written(batch_.boxes[i / kWidth], which);
    i += here;
  }
}

// What the filter drops moves all that follow.
void PointBvhBuilder::keep_filtered(std::size_t begin, std::size_t end, const PointFilter& drop) {
  for (std::size_t i = begin; i < end; ++i) {
    *room(1) = filtered_[i];
    keep(box_in(batch_.boxes[i / kWidth], static_cast<int>(i % kWidth)), drop);
  }
}

void PointBvhBuilder::build(const Eigen::Isometry3d& X_FO, const CloudPoint* points, std::size_t n,
                            const PointFilter& drop, PointBvh* index) {
  std::array<CloudPoint, PointCells::kSample> sample;
  const std::size_t stride = n / sample.size() | 1U;
  std::size_t count = 0;
  for (std::size_t i = 0; i < n && count < sample.size(); i += stride) sample[count++] = points[i];
  cells_.start(sample.data(), count, n);
  cells_.add(points, n);
  build(X_FO, drop, {}, index);
}

void PointBvhBuilder::build(const Eigen::Isometry3d& X_FO, const PointFilter& drop,
                            const BoxFilter& may_drop, PointBvh* index) {
  start(X_FO, index);
  // More than there will be, by far: how many it takes differs from cloud to cloud of a stream.
  const std::size_t enough = cells_.size() / (4 * kWidth) + kWidth;
  if (index->nodes_.capacity() < enough) index->nodes_.reserve(2 * enough);
  loose_.reserve(kEnough + TileBatch::kMost);
  for (auto cell = cells_.next(); cell.size > 0; cell = cells_.next()) {
    if (spare_.size() < cell.size + kPointSlack) spare_.resize(2 * (cell.size + kPointSlack));
    add_points(cell.points, spare_.data(), cell.size, {drop, may_drop});
    end_cell();
  }
  finish();
}

void PointBvhBuilder::build_in_order(const Eigen::Isometry3d& X_FO,
                                     const std::vector<CloudPoint>& points, PointBvh* index) {
  start(X_FO, index);
  add_runs(points.data(), points.size(), {});
  finish();
}

}  // namespace ist
