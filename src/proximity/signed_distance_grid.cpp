#include "proximity/signed_distance_grid.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"
#include "proximity/coherence/displacement.h"

namespace ist {
namespace {

// Relative error of a stored value.
constexpr double kStored = 1e-6;
// [m] More than double loses in the distance of two places of a link.
constexpr double kRounding = 1e-12;

}  // namespace

SignedDistanceGrid::SignedDistanceGrid(const LinkModel& link)
    : solid_(&link.solid),
      is_one_mesh_(is_one_mesh(link.solid)),
      has_holes_(!link.solid.is_closed()) {
  const Eigen::AlignedBox3d box = bounding_box(link);
  const Eigen::Vector3d sizes = box.sizes();
  const auto cells = [&](int axis) {
    return std::max(1, static_cast<int>(std::min(std::ceil(sizes[axis] / size_),
                                                 static_cast<double>(kMaxCells))));
  };
  size_ = std::max(1e-4, sizes.maxCoeff() / static_cast<double>(kMaxCells));
  for (;; size_ *= 1.1) {
    count_ = {cells(0), cells(1), cells(2)};
    const double all = static_cast<double>(count_[0]) * count_[1] * count_[2];
    if (all <= static_cast<double>(kMaxCells)) break;
  }
  per_size_ = 1.0 / size_;
  box_ = {box.min(), box.min() + size_ * Eigen::Vector3d(count_[0], count_[1], count_[2])};
  values_.assign(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]) *
                     static_cast<std::size_t>(count_[2]),
                 kUnknown);
}

// A place outside the box is in the nearest cell. Written so that NaN is in the first one.
SignedDistanceGrid::Cell SignedDistanceGrid::cell(const Eigen::Vector3d& p_LQ) const {
  const Eigen::Array3d at = per_size_ * (p_LQ - box_.min()).array();
  Eigen::Array3i i;
  for (int axis = 0; axis < 3; ++axis) {
    const int last = count_[axis] - 1;
    i[axis] = at[axis] > 0.0 ? (at[axis] < last ? static_cast<int>(at[axis]) : last) : 0;
  }
  return {static_cast<std::size_t>(i[0] + count_[0] * (i[1] + count_[1] * i[2])),
          box_.min() + size_ * (i.cast<double>() + 0.5).matrix()};
}

SignedDistanceGrid::Sample SignedDistanceGrid::sample(const Eigen::Vector3d& p_LQ,
                                                      const Cell& cell) const {
  const auto floor = static_cast<double>(values_[cell.index]);
  const double distance = (p_LQ - cell.center).norm() + kRounding;
  Sample sample{floor - distance, {}};
  if (!is_one_mesh_) return sample;
  sample.near.within = (1.0 + kStored) * std::abs(floor) + distance;
  if (!has_holes_ && distance < (1.0 - kStored) * std::abs(floor)) {
    sample.near.side = floor < 0.0 ? NearSurface::Side::kInside : NearSurface::Side::kOutside;
  }
  return sample;
}

bool SignedDistanceGrid::find(const Eigen::Vector3d& p_LQ, Sample* sample) const {
  if (!box_.contains(p_LQ)) return false;
  const Cell cell = this->cell(p_LQ);
  if (!(values_[cell.index] < kUnknown)) return false;
  *sample = this->sample(p_LQ, cell);
  return true;
}

SignedDistanceGrid::Sample SignedDistanceGrid::measure(const Eigen::Vector3d& p_LQ) {
  const Cell cell = this->cell(p_LQ);
  float& value = values_[cell.index];
  if (!(value < kUnknown)) value = round_down(point_depth(*solid_, cell.center, -1.0).floor);
  return sample(p_LQ, cell);
}

}  // namespace ist
