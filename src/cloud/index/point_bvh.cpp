#include "internal/cloud/point_bvh.h"

#include "cloud/index/tile_reader.h"

namespace ist {

PointBvh& PointBvh::operator=(const PointBvh& other) {
  if (this == &other) return *this;
  X_FO_ = other.X_FO_;
  bounds_ = other.bounds_;
  nodes_ = other.nodes_;
  tiles_.resize(other.tile_count());
  PointTile scratch;
  for (std::size_t i = 0; i < tiles_.size(); ++i) tiles_[i] = other.tile(i, &scratch);
  flags_.reset(tiles_.size());
  cloud_ = RawCloud();
  first_pixel_.assign(tiles_.size(), 0U);
  size_ = other.size_;
  root_ = other.root_;
  build_id_ = other.build_id_;
  is_thinned_ = other.is_thinned_;
  grid_ = other.grid_;
  if (is_thinned_) thinned_.reset(nodes_.size(), tiles_.size());
  return *this;
}

void PointBvh::clear() {
  bounds_.setEmpty();
  nodes_.clear();
  tiles_.clear();
  first_pixel_.clear();
  cloud_ = RawCloud();
  size_ = 0;
  root_ = -1;
  build_id_ = 0;
  is_thinned_ = false;
}

void PointBvh::set_thinning(double voxel_size) {
  is_thinned_ = true;
  grid_ = VoxelGrid(X_FO_, voxel_size);
  thinned_.reset(nodes_.size(), tiles_.size());
}

// The one reader that claims the tile reads it in its place, where nobody looks before it is
// published.
const PointTile& PointBvh::load(std::size_t i, PointTile* scratch) const {
  const bool is_first = flags_.claim(i);
  PointTile* const tile = is_first ? &tiles_[i] : scratch;
  read_tile(cloud_, X_OS_, first_pixel_[i], tile);
  if (is_first) flags_.publish(i);
  return *tile;
}

}  // namespace ist
