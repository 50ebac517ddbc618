#include "proximity/overlap_descent.h"

#include <limits>

#include "internal/geometry/box_distance.h"

namespace ist {
namespace {

// [m] The least point of the planes is looked for at these depths one after the other, by so many
// projections each.
constexpr std::array<double, 5> kDepths = {1e-3, 1e-4, 1e-5, 1e-6, 1e-7};
constexpr int kProjections = 60;

}  // namespace

const OverlapDescent::Plane& OverlapDescent::highest(const Eigen::Vector3d& p,
                                                     double* value) const {
  *value = -std::numeric_limits<double>::infinity();
  std::size_t best = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    const double height = planes_[i].normal.dot(p) - planes_[i].offset;
    if (height <= *value) continue;
    *value = height;
    best = i;
  }
  return planes_[best];
}

void OverlapDescent::take(double distance, const Eigen::Vector3d& normal_O) {
  planes_[count_++] = {normal_O, normal_O.dot(point_) - distance};
  double least = std::numeric_limits<double>::infinity();
  Eigen::Vector3d best = point_;
  for (const double depth : kDepths) {
    Eigen::Vector3d p = best;
    for (int i = 0; i < kProjections; ++i) {
      double value;
      const Plane& plane = highest(p, &value);
      if (value < least) {
        least = value;
        best = p;
      }
      p = clamp_to(box_, p - (value + depth) * plane.normal);
    }
  }
  point_ = best;
}

}  // namespace ist
