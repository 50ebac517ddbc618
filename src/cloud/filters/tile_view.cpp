#include "cloud/filters/tile_view.h"

#include <algorithm>
#include <array>
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
  looked_ = 0;
  bundles_.clear();
}

void TileView::add_link(const SelfFilter::Link& link, const Eigen::Isometry3d& X_LS) {
  bundles_.emplace_back();
  Bundle& bundle = bundles_.back();
  bundle.link = &link;
  bundle.R_LS = X_LS.linear();
  RayBundle::Directions directions_L;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if (!is_kept(k)) continue;
    directions_L.col(static_cast<Eigen::Index>(k)) = X_LS.linear() * direction_[k];
  }
  bundle.rays.begin(*link.solid, X_LS.translation(), directions_L, kept_, farthest_ + behind_);
  if (bundle.rays.empty()) bundles_.pop_back();
}

void TileView::look_at(std::uint32_t pixels) {
  const std::uint32_t rays = pixels & ~looked_;
  if (rays == 0) return;
  looked_ |= rays;
  std::array<double, kPixels> max_t;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    sights_[k] = {};
    max_t[k] = range_[k] + behind_;
  }
  std::array<RayHit, kPixels> hits;
  for (const Bundle& bundle : bundles_) {
    bundle.rays.cast(rays, max_t, &hits);
    for (std::size_t k = 0; k < kPixels; ++k) {
      if ((rays >> k & 1U) == 0) continue;
      Sight& sight = sights_[k];
      if (!(std::abs(hits[k].t - range_[k]) < std::abs(sight.t - range_[k]))) continue;
      sight = {hits[k].t, bundle.R_LS.transpose() * hits[k].normal, bundle.link};
    }
  }
}

}  // namespace ist
