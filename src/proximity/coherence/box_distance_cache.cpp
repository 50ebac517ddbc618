#include "proximity/coherence/box_distance_cache.h"

#include "internal/geometry/float_rounding.h"
#include "proximity/coherence/displacement.h"

namespace ist {

double displacement(const PlacedBox& A, const PlacedBox& B) {
  const Eigen::Matrix3d edges = B.half_L - A.half_L;
  const double turned = edges.col(0).norm() + edges.col(1).norm() + edges.col(2).norm();
  const double size = A.half_L.norm() + B.half_L.norm();
  return displacement(A.p_LC, B.p_LC) + (turned > 0.0 ? turned + kLostInLength * size : 0.0);
}

double BoxDistanceCache::find(std::uint32_t key, const PlacedBox& box) const {
  const Entry& entry = entries_[slot(key)];
  if (entry.key != key) return -std::numeric_limits<double>::infinity();
  return after_displacement(entry.lower_bound, displacement(box, entry.box));
}

void BoxDistanceCache::store(std::uint32_t key, const PlacedBox& box, double lower_bound) {
  entries_[slot(key)] = {key, lower_bound, box};
}

}  // namespace ist
