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

BoxDistanceCache::Kept BoxDistanceCache::find(std::uint32_t key, const PlacedBox& box) const {
  for (std::size_t i = first(key); i < first(key) + kWays; ++i) {
    const Entry& entry = entries_[i];
    if (entry.key != key) continue;
    const double left = after_displacement(entry.kept.lower_bound, displacement(box, entry.box));
    return {left, entry.kept.is_outside && left > 0.0};
  }
  return {};
}

void BoxDistanceCache::store(std::uint32_t key, const PlacedBox& box, const Kept& kept) {
  // Where all are taken, the key decides which one goes.
  std::size_t at = first(key) + key % kWays;
  for (std::size_t i = first(key); i < first(key) + kWays; ++i) {
    if (entries_[i].key == key) {
      at = i;
      break;
    }
    if (entries_[i].kept.lower_bound == -std::numeric_limits<double>::infinity()) at = i;
  }
  entries_[at] = {key, kept, box};
}

}  // namespace ist
