#include "proximity/known_distances.h"

#include <cmath>

#include "geometry/float_rounding.h"

namespace ist {

KnownDistances::Known KnownDistances::at(std::uint64_t index, Kind kind, std::uint32_t id,
                                         const Eigen::Vector3d& p_L) const {
  Known known;
  const Place& place = places_[slot(kind, id)];
  if (place.index != index || place.id != id || place.kind != kind) return known;
  const double gone = (p_L - place.p_L).norm();
  const double way = gone == 0.0 ? 0.0 : gone + kLostInLength * (p_L.norm() + place.p_L.norm());
  // Written so that NaN is unknown.
  if (!(way < std::numeric_limits<double>::infinity())) return known;
  known.floor = place.floor - way;
  known.way = way;
  known.guess = place.guess - way;
  return known;
}

void KnownDistances::keep(std::uint64_t index, Kind kind, std::uint32_t id,
                          const Eigen::Vector3d& p_L, double floor, double guess) {
  places_[slot(kind, id)] = {index, id, kind, floor, guess, p_L};
}

}  // namespace ist
