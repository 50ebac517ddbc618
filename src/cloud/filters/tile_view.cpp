#include "cloud/filters/tile_view.h"

#include <algorithm>
#include <cmath>

#include "cloud/format/point_reader.h"

namespace ist {

void TileView::read(const RawCloud& cloud, std::size_t row, std::size_t column,
                    std::uint32_t kept) {
  kept_ = kept;
  farthest_ = 0.0;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if (!is_kept(k)) continue;
    p_S_[k] = point_at(cloud, row + k / kTileSide, column + k % kTileSide);
    range_[k] = p_S_[k].norm();
    direction_[k] = p_S_[k] / range_[k];
    farthest_ = std::max(farthest_, range_[k]);
  }
}

void TileView::begin(double behind) {
  behind_ = behind;
  bundles_.clear();
}

void TileView::add_link(const SelfFilter::Link& link, const Eigen::Isometry3d& X_LS) {
  Eigen::AlignedBox3d directions_L;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if (is_kept(k)) directions_L.extend(X_LS.linear() * direction_[k]);
  }
  bundles_.emplace_back();
  Bundle& bundle = bundles_.back();
  bundle.link = &link;
  bundle.R_LS = X_LS.linear();
  bundle.rays.begin(*link.solid, X_LS.translation(), directions_L, farthest_ + behind_);
  if (bundle.rays.empty()) bundles_.pop_back();
}

TileView::Sight TileView::look(std::size_t k) const {
  Sight sight;
  for (const Bundle& bundle : bundles_) {
    const RayHit hit = bundle.rays.cast(bundle.R_LS * direction_[k], range_[k] + behind_);
    if (!(std::abs(hit.t - range_[k]) < std::abs(sight.t - range_[k]))) continue;
    sight.t = hit.t;
    sight.normal = bundle.R_LS.transpose() * hit.normal;
    sight.link = bundle.link;
  }
  return sight;
}

}  // namespace ist
