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
  others_.clear();
  bundles_.clear();
}

void TileView::add_link(const SelfFilter::Link& link, const Eigen::Isometry3d& X_LS) {
  others_.push_back({&link, &X_LS});
}

// Whether the surface of a link may be as near to a point, along its ray, as what the ray is known
// to meet. Otherwise the distance of the points to the link proves that it changes no sight.
bool TileView::may_be_nearer(const Other& other, std::uint32_t rays) const {
  Eigen::AlignedBox3d box;
  double apart = 0.0;  // [m] the farthest that a known surface is from its point
  for (std::size_t k = 0; k < kPixels; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    apart = std::max(apart, std::abs(sights_[k].t - range_[k]));
    box.extend(p_S_[k]);
  }
  if (!std::isfinite(apart)) return true;
  constexpr double kRounding = 1e-6;
  const double limit = (apart + 0.5 * box.diagonal().norm()) * (1.0 + kRounding);
  const InnerSphereTree& tree = *other.link->tree;
  return !tree.cover_distance_exceeds(*other.X_LS * box.center(),
                                      std::max(limit, tree.interior_gap()));
}

void TileView::open(const Other& other) {
  bundles_.emplace_back();
  Bundle& bundle = bundles_.back();
  bundle.link = other.link;
  bundle.R_LS = other.X_LS->linear();
  RayBundle::Directions directions_L;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if (!is_kept(k)) continue;
    directions_L.col(static_cast<Eigen::Index>(k)) = bundle.R_LS * direction_[k];
  }
  bundle.rays.begin(*other.link->solid, other.X_LS->translation(), directions_L, kept_,
                    farthest_ + behind_);
}

void TileView::cast(const Bundle& bundle, std::uint32_t rays) {
  if (bundle.rays.empty()) return;
  std::array<double, kPixels> max_t;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if ((rays >> k & 1U) != 0) max_t[k] = range_[k] + behind_;
  }
  std::array<RayHit, kPixels> hits;
  bundle.rays.cast(rays, max_t, &hits);
  for (std::size_t k = 0; k < kPixels; ++k) {
    if ((rays >> k & 1U) == 0) continue;
    Sight& sight = sights_[k];
    const double apart = std::abs(hits[k].t - range_[k]), known = std::abs(sight.t - range_[k]);
    // The first link's counts of two surfaces that are equally near, in whatever order they come.
    const bool is_first =
        apart == known && sight.link != nullptr && bundle.link->number < sight.link->number;
    if (!(apart < known || is_first)) continue;
    sight = {hits[k].t, bundle.R_LS.transpose() * hits[k].normal, bundle.link};
  }
}

void TileView::look_at(std::uint32_t pixels) {
  const std::uint32_t rays = pixels & ~looked_;
  if (rays == 0) return;
  looked_ |= rays;
  for (std::size_t k = 0; k < kPixels; ++k) {
    if ((rays >> k & 1U) != 0) sights_[k] = {};
  }
  for (const Bundle& bundle : bundles_) cast(bundle, rays);
  std::size_t left = 0;
  for (const Other& other : others_) {
    if (may_be_nearer(other, rays)) {
      open(other);
      cast(bundles_.back(), rays);
    } else {
      others_[left++] = other;
    }
  }
  others_.erase(others_.begin() + static_cast<std::ptrdiff_t>(left), others_.end());
}

}  // namespace ist
