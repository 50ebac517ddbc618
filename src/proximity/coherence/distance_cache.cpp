#include "proximity/coherence/distance_cache.h"

#include <limits>

#include "proximity/coherence/displacement.h"

namespace ist {

double DistanceCache::find(Quantity quantity, std::uint32_t key,
                           const Eigen::Vector3d& p_LQ) const {
  const Entry& entry = entries_[slot(quantity, key)];
  if (entry.key != key || entry.quantity != quantity) {
    return -std::numeric_limits<double>::infinity();
  }
  return after_displacement(entry.lower_bound, displacement(p_LQ, entry.p_LQ));
}

void DistanceCache::store(Quantity quantity, std::uint32_t key, const Eigen::Vector3d& p_LQ,
                          double lower_bound) {
  entries_[slot(quantity, key)] = {key, quantity, lower_bound, p_LQ};
}

}  // namespace ist
