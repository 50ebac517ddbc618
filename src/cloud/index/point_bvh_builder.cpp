#include "cloud/index/point_bvh_builder.h"

#include <algorithm>

#include "cloud/index/tile_box.h"
#include "cloud/index/tile_reader.h"
#include "internal/bvh/build_id.h"

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::size_t>(kPointWidth);

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

// Whether tiles that are neighbours shall be a node: most of it is used, and they lie side by side.
bool make_a_node(const HierarchyChild* tiles, std::size_t count) {
  if (count < kWidth / 2 || count > kWidth) return false;
  PaddedBox around = tiles[0].box;
  float sum = 0.0F;
  for (std::size_t i = 0; i < count; ++i) {
    around.extend(tiles[i].box);
    sum += tiles[i].box.diagonal();
  }
  return lie_close_together(around.diagonal(), sum, count);
}

}  // namespace

void PointBvhBuilder::start(const Eigen::Isometry3d& X_FO, PointBvh* index) {
  index_ = index;
  used_ = 0;
  index->build_id_ = next_build_id();
  index->X_FO_ = X_FO;
  index->size_ = 0;
  index->nodes_.clear();
  index->cloud_ = RawCloud();
  unread_.clear();
  loose_.clear();
  neighbours_ = 0;
}

PointTile* PointBvhBuilder::room(std::size_t count) {
  std::vector<PointTile>& tiles = index_->tiles_;
  if (used_ + count > tiles.size()) {
    tiles.resize(used_ + count);
    index_->first_pixel_.resize(used_ + count);
  }
  return &tiles[used_];
}

void PointBvhBuilder::keep(const PaddedBox& box, const PointFilter& drop) {
  PointTile& tile = index_->tiles_[used_];
  PaddedBox left = box;
  if (drop) {
    const std::uint32_t dropped = drop(tile, box);
    if (dropped != 0) {
      remove(dropped, &tile);
      if (tile.count == 0) return;
      left = box_of(tile);
    }
  }
  put_unused_far_away(&tile);
  index_->size_ += static_cast<std::size_t>(tile.count);
  loose_.push_back({left, ~static_cast<std::int32_t>(used_)});
  ++used_;
}

void PointBvhBuilder::keep_written(const BoxNode& boxes, std::uint32_t which) {
  for (int k = 0; which >> k != 0; ++k) {
    if ((which >> k & 1U) == 0) continue;
    index_->size_ += static_cast<std::size_t>(index_->tiles_[used_].count);
    loose_.push_back({box_in(boxes, k), ~static_cast<std::int32_t>(used_)});
    ++used_;
  }
}

void PointBvhBuilder::start_image(const Eigen::Isometry3d& X_FO, const RawCloud& image,
                                  const Eigen::Isometry3d& X_OS, PointBvh* index) {
  start(X_FO, index);
  index->cloud_ = image;
  index->X_OS_ = X_OS;
}

void PointBvhBuilder::add_unread(const std::uint32_t* first_pixels, std::size_t count) {
  PointTile* tiles = room(count);
  if (index_->cloud_.owner == nullptr) {
    for (std::size_t i = 0; i < count; ++i) {
      read_tile(index_->cloud_, index_->X_OS_, first_pixels[i], &tiles[i]);
    }
  } else {
    std::copy_n(first_pixels, count, &index_->first_pixel_[used_]);
    if (unread_.empty() || unread_.back().first + unread_.back().count != used_) {
      unread_.push_back({used_, 0});
    }
    unread_.back().count += count;
  }
  used_ += count;
  index_->size_ += count * static_cast<std::size_t>(kPointWidth);
}

void PointBvhBuilder::keep_unread(const PaddedBox& box, std::uint32_t first_pixel) {
  loose_.push_back({box, ~static_cast<std::int32_t>(used_)});
  add_unread(&first_pixel, 1);
}

void PointBvhBuilder::keep_unread_node(const BoxNode& boxes, const std::uint32_t* first_pixels) {
  index_->nodes_.push_back(boxes);
  BoxNode& node = index_->nodes_.back();
  node.count = kPointWidth;
  for (int k = 0; k < kPointWidth; ++k) node.child[k] = ~(static_cast<std::int32_t>(used_) + k);
  add_unread(first_pixels, kWidth);
}

void PointBvhBuilder::end_neighbours() {
  const std::size_t count = loose_.size() - neighbours_;
  if (make_a_node(loose_.data() + neighbours_, count)) {
    index_->nodes_.emplace_back();
    BoxNode& node = index_->nodes_.back();
    clear_boxes(&node);
    for (std::size_t i = neighbours_; i < loose_.size(); ++i) {
      node.child[append_box(loose_[i].box, &node)] = loose_[i].child;
    }
    loose_.resize(neighbours_);
  }
  neighbours_ = loose_.size();
}

void PointBvhBuilder::finish() {
  index_->tiles_.resize(used_);
  index_->first_pixel_.resize(used_);
  index_->flags_.reset(used_);
  for (const Run& run : unread_) index_->flags_.mark_not_loaded(run.first, run.count);
  std::vector<BoxNode>& nodes = index_->nodes_;
  hierarchy_.append_nodes(loose_, &nodes);
  hierarchy_.append_levels(&nodes);
  if (index_->cloud_.owner == nullptr) index_->cloud_ = RawCloud();  // its bytes may go
  index_->root_ = static_cast<std::int32_t>(nodes.size()) - 1;
  index_->bounds_.setEmpty();
  if (nodes.empty()) return;
  const PaddedBox box = bounds_of(nodes.back());
  index_->bounds_ = Eigen::AlignedBox3f(box.min.head<3>().matrix(), box.max.head<3>().matrix());
}

}  // namespace ist
