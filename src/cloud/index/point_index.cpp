#include "ist_proximity/cloud/point_index.h"

#include "cloud/index/point_index_builder.h"
#include "cloud/index/tile_reader.h"

namespace ist {

PointIndex& PointIndex::operator=(const PointIndex& other) {
  if (this == &other) return *this;
  X_FO_ = other.X_FO_;
  bounds_ = other.bounds_;
  nodes_ = other.nodes_;
  tiles_.resize(other.tile_count());
  PointTile room;
  for (std::size_t i = 0; i < tiles_.size(); ++i) tiles_[i] = other.tile(i, &room);
  written_.reset(tiles_.size());
  image_ = RawCloud();
  first_pixel_.assign(tiles_.size(), 0U);
  size_ = other.size_;
  root_ = other.root_;
  build_id_ = other.build_id_;
  return *this;
}

const PointTile& PointIndex::read(std::size_t i, PointTile* room) const {
  read_tile(image_, X_OS_, first_pixel_[i], room);
  if (written_.claim(i)) {
    tiles_[i] = *room;
    written_.publish(i);
  }
  return *room;
}

void PointIndex::build(const Eigen::Vector3d& origin, const float* x, const float* y,
                       const float* z, const std::uint32_t* id, std::size_t n) {
  std::vector<CloudPoint> points(n);
  for (std::size_t i = 0; i < n; ++i) points[i] = {x[i], y[i], z[i], id[i]};
  PointIndexBuilder().build(Eigen::Isometry3d(Eigen::Translation3d(origin)), points.data(), n, {},
                            this);
}

}  // namespace ist
