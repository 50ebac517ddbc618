#include "cloud/index/point_bvh_builder.h"

#include <algorithm>

#include "cloud/index/split_rule.h"
#include "cloud/index/tile_bounds.h"
#include "cloud/index/tile_reader.h"
#include "internal/bvh/build_id.h"

namespace ist {
namespace {

// A message is not kept for fewer lazy tiles than one in this many: it is about as large as all
// tiles.
constexpr std::size_t kLazyShare = 16;

// Removes the points whose bit is set.
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

// Whether neighbouring tiles are to be a node: they fill most of it and are close together.
bool is_node_worthwhile(const HierarchyChild* tiles, std::size_t count) {
  if (count < kTilePoints / 2 || count > kTilePoints) return false;
  PaddedBox bounds = tiles[0].box;
  float sum = 0.0F;
  for (std::size_t i = 0; i < count; ++i) {
    bounds.extend(tiles[i].box);
    sum += tiles[i].box.diagonal();
  }
  return are_close_together(bounds.diagonal(), sum, count);
}

}  // namespace

void PointBvhBuilder::start(const Eigen::Isometry3d& X_FO, PointBvh* bvh) {
  bvh_ = bvh;
  used_ = 0;
  bvh->build_id_ = next_build_id();
  bvh->X_FO_ = X_FO;
  bvh->size_ = 0;
  bvh->nodes_.clear();
  bvh->cloud_ = RawCloud();
  bvh->is_thinned_ = false;
  lazy_runs_.clear();
  ungrouped_.clear();
  group_begin_ = 0;
}

PointTile* PointBvhBuilder::next_tiles(std::size_t count) {
  PageVector<PointTile>& tiles = bvh_->tiles_;
  if (used_ + count > tiles.size()) {
    tiles.resize(used_ + count);
    bvh_->first_pixel_.resize(used_ + count);
  }
  return &tiles[used_];
}

void PointBvhBuilder::add_tile(const PaddedBox& box, const PointFilter& drop) {
  PointTile& tile = bvh_->tiles_[used_];
  PaddedBox kept_box = box;
  if (drop) {
    const std::uint32_t dropped = drop(tile, box);
    if (dropped != 0) {
      remove(dropped, &tile);
      if (tile.count == 0) return;
      kept_box = box_of(tile);
    }
  }
  put_unused_far_away(&tile);
  bvh_->size_ += static_cast<std::size_t>(tile.count);
  ungrouped_.push_back({kept_box, ~static_cast<std::int32_t>(used_)});
  ++used_;
}

void PointBvhBuilder::add_loaded_tiles(const BoxNode& boxes, std::uint32_t which) {
  for (int k = 0; which >> k != 0; ++k) {
    if ((which >> k & 1U) == 0) continue;
    bvh_->size_ += static_cast<std::size_t>(bvh_->tiles_[used_].count);
    ungrouped_.push_back({box_in(boxes, k), ~static_cast<std::int32_t>(used_)});
    ++used_;
  }
}

void PointBvhBuilder::start_organized(const Eigen::Isometry3d& X_FO, const RawCloud& cloud,
                                      const Eigen::Isometry3d& X_OS, PointBvh* bvh) {
  start(X_FO, bvh);
  bvh->cloud_ = cloud;
  bvh->X_OS_ = X_OS;
  // Reserved pages cost nothing; those of tiles that no query looks at are never written to, which
  // a copy to a larger array would do.
  const std::size_t squares =
      ((cloud.width + kTileSide - 1) / kTileSide) * ((cloud.height + kTileSide - 1) / kTileSide);
  if (bvh->tiles_.capacity() < squares) {
    bvh->tiles_.clear();
    bvh->tiles_.reserve(squares + squares / 2);  // tiles with an edge are split
    bvh->first_pixel_.clear();
    bvh->first_pixel_.reserve(squares + squares / 2);
  }
}

void PointBvhBuilder::append_lazy(const std::uint32_t* first_pixels, std::size_t count) {
  PointTile* tiles = next_tiles(count);
  if (bvh_->cloud_.owner == nullptr) {
    for (std::size_t i = 0; i < count; ++i) {
      read_tile(bvh_->cloud_, bvh_->X_OS_, first_pixels[i], &tiles[i]);
    }
  } else {
    std::copy_n(first_pixels, count, &bvh_->first_pixel_[used_]);
    if (lazy_runs_.empty() || lazy_runs_.back().first + lazy_runs_.back().count != used_) {
      lazy_runs_.push_back({used_, 0});
    }
    lazy_runs_.back().count += count;
  }
  used_ += count;
  bvh_->size_ += count * static_cast<std::size_t>(kPointWidth);
}

void PointBvhBuilder::add_lazy_tile(const PaddedBox& box, std::uint32_t first_pixel) {
  ungrouped_.push_back({box, ~static_cast<std::int32_t>(used_)});
  append_lazy(&first_pixel, 1);
}

void PointBvhBuilder::add_lazy_node(const BoxNode& boxes, const std::uint32_t* first_pixels) {
  bvh_->nodes_.push_back(boxes);
  BoxNode& node = bvh_->nodes_.back();
  node.count = kPointWidth;
  for (int k = 0; k < kPointWidth; ++k) node.child[k] = ~(static_cast<std::int32_t>(used_) + k);
  append_lazy(first_pixels, kTilePoints);
}

void PointBvhBuilder::end_group() {
  const std::size_t count = ungrouped_.size() - group_begin_;
  if (is_node_worthwhile(ungrouped_.data() + group_begin_, count)) {
    bvh_->nodes_.emplace_back();
    BoxNode& node = bvh_->nodes_.back();
    clear_boxes(&node);
    for (std::size_t i = group_begin_; i < ungrouped_.size(); ++i) {
      node.child[append_box(ungrouped_[i].box, &node)] = ungrouped_[i].child;
    }
    ungrouped_.resize(group_begin_);
  }
  group_begin_ = ungrouped_.size();
}

// Reads the lazy tiles where they are so few that the message is not worth its memory, as in an
// image with a missing pixel in nearly every tile.
void PointBvhBuilder::read_few_lazy_tiles() {
  std::size_t lazy = 0;
  for (const TileRun& run : lazy_runs_) lazy += run.count;
  if (lazy * kLazyShare >= used_) return;
  for (const TileRun& run : lazy_runs_) {
    for (std::size_t i = run.first; i < run.first + run.count; ++i) {
      read_tile(bvh_->cloud_, bvh_->X_OS_, bvh_->first_pixel_[i], &bvh_->tiles_[i]);
    }
  }
  lazy_runs_.clear();
  bvh_->cloud_.owner = nullptr;
}

void PointBvhBuilder::finish() {
  read_few_lazy_tiles();
  bvh_->tiles_.resize(used_);
  bvh_->first_pixel_.resize(used_);
  bvh_->flags_.reset(used_);
  for (const TileRun& run : lazy_runs_) bvh_->flags_.mark_not_loaded(run.first, run.count);
  std::vector<BoxNode>& nodes = bvh_->nodes_;
  hierarchy_.append_nodes(ungrouped_, &nodes);
  hierarchy_.append_levels(&nodes);
  if (bvh_->cloud_.owner == nullptr) bvh_->cloud_ = RawCloud();  // not valid after the call
  bvh_->root_ = static_cast<std::int32_t>(nodes.size()) - 1;
  bvh_->bounds_.setEmpty();
  if (nodes.empty()) return;
  const PaddedBox box = bounds_of(nodes.back());
  bvh_->bounds_ = Eigen::AlignedBox3f(box.min.head<3>().matrix(), box.max.head<3>().matrix());
}

}  // namespace ist
