#include "proximity/known_distances.h"

#include <cmath>
#include <limits>

#include "internal/geometry/float_rounding.h"

namespace ist {

double KnownDistances::at(std::uint64_t index, Kind kind, std::uint32_t id,
                          const Eigen::Vector3d& p_L) const {
  const Place& place = places_[slot(kind, id)];
  if (place.index != index || place.id != id || place.kind != kind) {
    return -std::numeric_limits<double>::infinity();
  }
  const double gone = (p_L - place.p_L).norm();
  const double way = gone == 0.0 ? 0.0 : gone + kLostInLength * (p_L.norm() + place.p_L.norm());
  // Written so that NaN is unknown.
  return way < std::numeric_limits<double>::infinity() ? place.floor - way
                                                       : -std::numeric_limits<double>::infinity();
}

void KnownDistances::keep(std::uint64_t index, Kind kind, std::uint32_t id,
                          const Eigen::Vector3d& p_L, double floor) {
  places_[slot(kind, id)] = {index, id, kind, floor, p_L};
}

}  // namespace ist
