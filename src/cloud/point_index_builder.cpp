#include "cloud/point_index_builder.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::uint32_t>(kPointWidth);

// A run is cut at its longest leap if the diagonals of the two parts add up to less than this share
// of the whole's. Four by four points of a plane, halved, come to 1.6; a leap to 0.3. Measured on
// depth images and lidar scans, 0.6 to 0.8 is best: fewer cuts leave long tiles, more leave tiles
// half empty.
constexpr float kCutBelow = 0.7F;

// Sixteen numbers side by side; Eigen turns them into SIMD.
using Lanes = Eigen::Array<float, kPointWidth, 1>;
using LaneMap = Eigen::Map<const Lanes>;

// The box of the slots that `mask` leaves: -inf where a slot belongs, inf where not.
PaddedBox box_of(const PointTile& tile, const Lanes& mask) {
  const LaneMap x(tile.x), y(tile.y), z(tile.z);
  return {{x.max(mask).minCoeff(), y.max(mask).minCoeff(), z.max(mask).minCoeff(), 0.0F},
          {x.min(-mask).maxCoeff(), y.min(-mask).maxCoeff(), z.min(-mask).maxCoeff(), 0.0F}};
}

PaddedBox box_of(const PointTile& tile) {
  const LaneMap x(tile.x), y(tile.y), z(tile.z);
  return {{x.minCoeff(), y.minCoeff(), z.minCoeff(), 0.0F},
          {x.maxCoeff(), y.maxCoeff(), z.maxCoeff(), 0.0F}};
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

// Slots from `count` on become the one before: they add nothing to the box, and no step.
void repeat_last(std::uint32_t count, PointTile* tile) {
  for (std::uint32_t k = count; k < kWidth; ++k) {
    tile->x[k] = tile->x[count - 1];
    tile->y[k] = tile->y[count - 1];
    tile->z[k] = tile->z[count - 1];
  }
  tile->count = static_cast<std::int32_t>(count);
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
    if (!(front_box.diagonal() + back_box.diagonal() < kCutBelow * box.diagonal())) break;
    repeat_last(static_cast<std::uint32_t>(front), tile);
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
  if (kept > 0) repeat_last(kept, tile);
}

void put_unused_far_away(PointTile* tile) {
  for (std::int32_t k = tile->count; k < kPointWidth; ++k) {
    tile->x[k] = tile->y[k] = tile->z[k] = kFarAway;
    tile->id[k] = 0;
  }
}

std::size_t nodes_over(std::size_t children) { return (children + kWidth - 1) / kWidth; }

void clear(BoxNode* node) {
  for (int k = 0; k < kPointWidth; ++k) {
    node->min_x[k] = node->min_y[k] = node->min_z[k] = kFarAway;
    node->max_x[k] = node->max_y[k] = node->max_z[k] = kFarAway;
    node->child[k] = 0;
  }
  node->count = 0;
}

void append(std::int32_t child, const PaddedBox& box, BoxNode* node) {
  const int k = node->count++;
  node->min_x[k] = box.min[0];
  node->min_y[k] = box.min[1];
  node->min_z[k] = box.min[2];
  node->max_x[k] = box.max[0];
  node->max_y[k] = box.max[1];
  node->max_z[k] = box.max[2];
  node->child[k] = child;
}

PaddedBox child_box(const BoxNode& node, int k) {
  return {{node.min_x[k], node.min_y[k], node.min_z[k], 0.0F},
          {node.max_x[k], node.max_y[k], node.max_z[k], 0.0F}};
}

PaddedBox box_of(const BoxNode& node) {
  PaddedBox box = child_box(node, 0);
  for (int k = 1; k < node.count; ++k) box.extend(child_box(node, k));
  return box;
}

}  // namespace

void PointIndexBuilder::build(const Eigen::Vector3d& origin, const float* x, const float* y,
                              const float* z, const std::uint32_t* id, std::size_t n,
                              const PointFilter& drop, PointIndex* index) {
  morton_.sort(x, y, z, n, &order_);
  static std::atomic<std::uint64_t> builds{0};
  index->generation_ = ++builds;
  index->origin_ = origin;
  index->size_ = 0;
  boxes_.clear();
  items_.clear();
  // Tiles of the last time are overwritten in place, which saves clearing them first.
  std::vector<PointTile>& tiles = index->tiles_;
  std::size_t used = 0;
  for (std::size_t first = 0; first < n;) {
    if (used == tiles.size()) tiles.emplace_back();
    PointTile& tile = tiles[used];
    const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(kWidth, n - first));
    for (std::uint32_t k = 0; k < count; ++k) {
      const std::uint32_t point = order_[first + k];
      tile.x[k] = x[point];
      tile.y[k] = y[point];
      tile.z[k] = z[point];
      tile.id[k] = id[point];
    }
    repeat_last(count, &tile);
    PaddedBox box = cut(&tile);
    first += static_cast<std::size_t>(tile.count);
    if (drop) {
      const std::uint32_t dropped = drop(tile, box);
      if (dropped != 0) {
        remove(dropped, &tile);
        if (tile.count == 0) continue;
        box = box_of(tile);
      }
    }
    put_unused_far_away(&tile);
    index->size_ += static_cast<std::size_t>(tile.count);
    items_.push_back({(box.min + box.max).head<3>(), static_cast<std::int32_t>(used)});
    boxes_.push_back(box);
    ++used;
  }
  tiles.resize(used);
  arrange(0, items_.size());
  write_nodes(index);
}

// Orders the tiles so that nodes can be filled with sixteen consecutive children on every level: a
// range is parted near the middle, at a multiple of what a whole child holds.
void PointIndexBuilder::arrange(std::size_t first, std::size_t last) {
  while (last - first > kWidth) {
    const std::size_t count = last - first;
    std::size_t unit = kWidth;
    while (unit * kWidth < count) unit *= kWidth;
    const std::size_t half = std::max<std::size_t>((count / 2 + unit / 2) / unit, 1) * unit;

    Eigen::Array3f min = items_[first].center, max = min;
    for (std::size_t i = first + 1; i < last; ++i) {
      min = min.min(items_[i].center.array());
      max = max.max(items_[i].center.array());
    }
    Eigen::Index axis;
    (max - min).maxCoeff(&axis);
    const auto at = [this](std::size_t i) {
      return items_.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(at(first), at(first + half), at(last), [axis](const Item& a, const Item& b) {
      return a.center[axis] < b.center[axis];
    });
    arrange(first, first + half);
    first += half;
  }
}

void PointIndexBuilder::write_nodes(PointIndex* index) const {
  std::vector<BoxNode>& nodes = index->nodes_;
  index->bounds_.setEmpty();
  index->root_ = -1;
  nodes.resize(nodes_over(items_.size()));
  if (nodes.empty()) return;
  for (BoxNode& node : nodes) clear(&node);
  for (std::size_t i = 0; i < items_.size(); ++i) {
    const std::int32_t tile = items_[i].tile;
    append(~tile, boxes_[static_cast<std::size_t>(tile)], &nodes[i / kWidth]);
  }
  std::size_t begin = 0, end = nodes.size();
  while (end - begin > 1) {
    nodes.resize(end + nodes_over(end - begin));
    for (std::size_t i = end; i < nodes.size(); ++i) clear(&nodes[i]);
    for (std::size_t i = begin; i < end; ++i) {
      append(static_cast<std::int32_t>(i), box_of(nodes[i]), &nodes[end + (i - begin) / kWidth]);
    }
    begin = end;
    end = nodes.size();
  }
  index->root_ = static_cast<std::int32_t>(begin);
  const PaddedBox box = box_of(nodes[begin]);
  index->bounds_ = Eigen::AlignedBox3f(box.min.head<3>().matrix(), box.max.head<3>().matrix());
}

}  // namespace ist
