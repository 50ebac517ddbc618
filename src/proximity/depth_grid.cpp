#include "proximity/depth_grid.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"
#include "proximity/carried_bound.h"

namespace ist {
namespace {

// What a stored number may be off, as a share of it.
constexpr double kStored = 1e-6;
// [m] Above what double loses between two places of a link.
constexpr double kRounding = 1e-12;

}  // namespace

DepthGrid::DepthGrid(const LinkModel& link)
    : solid_(&link.solid),
      tells_surface_(is_one_mesh(link.solid)),
      has_holes_(!link.solid.is_closed()) {
  const Eigen::AlignedBox3d box = box_of(link);
  const Eigen::Vector3d sizes = box.sizes();
  const auto cells = [&](int axis) {
    return std::max(1, static_cast<int>(std::min(std::ceil(sizes[axis] / size_),
                                                 static_cast<double>(kMostCells))));
  };
  size_ = std::max(1e-4, sizes.maxCoeff() / static_cast<double>(kMostCells));
  for (;; size_ *= 1.1) {
    count_ = {cells(0), cells(1), cells(2)};
    const double all = static_cast<double>(count_[0]) * count_[1] * count_[2];
    if (all <= static_cast<double>(kMostCells)) break;
  }
  per_size_ = 1.0 / size_;
  box_ = {box.min(), box.min() + size_ * Eigen::Vector3d(count_[0], count_[1], count_[2])};
  values_.assign(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) *
                     static_cast<std::size_t>(count_[2]),
                 kUnknown);
}

// The nearest one, for places beyond the box. Written so that NaN is in the first.
DepthGrid::Cell DepthGrid::cell(const Eigen::Vector3d& p_L) const {
  const Eigen::Array3d at = per_size_ * (p_L - box_.min()).array();
  Eigen::Array3i i;
  for (int axis = 0; axis < 3; ++axis) {
    const int last = count_[axis] - 1;
    i[axis] = at[axis] > 0.0 ? (at[axis] < last ? static_cast<int>(at[axis]) : last) : 0;
  }
  return {static_cast<std::size_t>(i[0] + count_[0] * (i[1] + count_[1] * i[2])),
          box_.min() + size_ * (i.cast<double>() + 0.5).matrix()};
}

DepthGrid::Found DepthGrid::tell(const Eigen::Vector3d& p_L, const Cell& cell) const {
  const auto floor = static_cast<double>(values_[cell.index]);
  const double way = (p_L - cell.middle).norm() + kRounding;
  Found found{floor - way, {}};
  if (!tells_surface_) return found;
  found.near.within = (1.0 + kStored) * std::abs(floor) + way;
  if (!has_holes_ && way < (1.0 - kStored) * std::abs(floor)) {
    found.near.side = floor < 0.0 ? NearSurface::Side::kInside : NearSurface::Side::kOutside;
  }
  return found;
}

bool DepthGrid::look(const Eigen::Vector3d& p_L, Found* found) const {
  if (!box_.contains(p_L)) return false;
  const Cell cell = this->cell(p_L);
  if (!(values_[cell.index] < kUnknown)) return false;
  *found = tell(p_L, cell);
  return true;
}

DepthGrid::Found DepthGrid::measure(const Eigen::Vector3d& p_L) {
  const Cell cell = this->cell(p_L);
  float& value = values_[cell.index];
  if (!(value < kUnknown)) value = round_down(point_depth(*solid_, cell.middle, -1.0).floor);
  return tell(p_L, cell);
}

}  // namespace ist
