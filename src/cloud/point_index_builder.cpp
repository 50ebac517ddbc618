#include "cloud/point_index_builder.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cloud/tile_box.h"

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::uint32_t>(kPointWidth);

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

// Where the second part begins when points are parted at the longest step between neighbours.
std::int32_t longest_leap(const PointTile& tile) {
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
  return k + (in_front ? 1 : kHalf);
}

// Shortens a tile until no leap is worth a cut; gives its box.
PaddedBox cut(PointTile* tile) {
  PaddedBox box = box_of(*tile);
  while (tile->count > 1) {
    const std::int32_t front = longest_leap(*tile);
    const Lanes mask = mask_of_first(front);
    const PaddedBox front_box = box_of(*tile, mask), back_box = box_of(*tile, -mask);
    if (!is_worth_a_cut(front_box, back_box, box)) break;
    tile->count = front;
    repeat_last(tile);
    box = front_box;
  }
  return box;
}

// Leaves out the points whose bit is set.
void remove(std::uint32_t dropped, PointTile* tile) {
  std::uint32_t kept = 0;
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(tile->count); ++k) {
    if ((dropped >> k & 1U) != 0) continue;
    tile->x[kept] = tile->x[k];
    tile->y[kept] = tile->y[k];
    tile->z[kept] = tile->z[k];
    tile->id[kept] = tile->id[k];
    ++kept;
  }
  tile->count = static_cast<std::int32_t>(kept);
  if (kept > 0) repeat_last(tile);
}

void put_unused_far_away(PointTile* tile) {
  for (std::int32_t k = tile->count; k < kPointWidth; ++k) {
    tile->x[k] = tile->y[k] = tile->z[k] = kFarAway;
    tile->id[k] = 0;
  }
}

}  // namespace

void PointIndexBuilder::start(const Eigen::Vector3d& origin, PointIndex* index) {
  index_ = index;
  used_ = 0;
  index->generation_ = next_generation();
  index->origin_ = origin;
  index->size_ = 0;
  boxes_.clear();
  items_.clear();
}

PointTile& PointIndexBuilder::next() {
  std::vector<PointTile>& tiles = index_->tiles_;
  if (used_ == tiles.size()) tiles.emplace_back();
  return tiles[used_];
}

void PointIndexBuilder::keep(const PaddedBox& all, const PointFilter& drop) {
  PointTile& tile = index_->tiles_[used_];
  PaddedBox box = all;
  if (drop) {
    const std::uint32_t dropped = drop(tile, box);
    if (dropped != 0) {
      remove(dropped, &tile);
      if (tile.count == 0) return;
      box = box_of(tile);
    }
  }
  put_unused_far_away(&tile);
  index_->size_ += static_cast<std::size_t>(tile.count);
  items_.push_back({(box.min + box.max).head<3>(), static_cast<std::int32_t>(used_)});
  boxes_.push_back(box);
  ++used_;
}

void PointIndexBuilder::finish() {
  index_->tiles_.resize(used_);
  arrange(&items_);
  write_nodes(items_, boxes_, &index_->nodes_);
  index_->root_ = static_cast<std::int32_t>(index_->nodes_.size()) - 1;
  index_->bounds_.setEmpty();
  if (index_->root_ < 0) return;
  const PaddedBox box = box_of(index_->nodes_.back());
  index_->bounds_ = Eigen::AlignedBox3f(box.min.head<3>().matrix(), box.max.head<3>().matrix());
}

void PointIndexBuilder::build(const Eigen::Vector3d& origin, const float* x, const float* y,
                              const float* z, const std::uint32_t* id, std::size_t n,
                              const PointFilter& drop, PointIndex* index) {
  morton_.sort(x, y, z, n, &order_);
  start(origin, index);
  for (std::size_t first = 0; first < n;) {
    PointTile& tile = next();
    const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(kWidth, n - first));
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t point = order_[first + k];
      tile.x[k] = x[point];
      tile.y[k] = y[point];
      tile.z[k] = z[point];
      tile.id[k] = id[point];
    }
    tile.count = static_cast<std::int32_t>(count);
    repeat_last(&tile);
    const PaddedBox box = cut(&tile);
    first += static_cast<std::size_t>(tile.count);
    keep(box, drop);
  }
  finish();
}

}  // namespace ist
