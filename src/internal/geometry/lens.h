#pragma once

#include <algorithm>
#include <cmath>

namespace ist {

/// The volume [m^3] of the intersection of two spheres: a lens, or the smaller sphere if the larger
/// one contains it.
///   V = pi (R + r - d)^2 (d^2 + 2 d (R + r) - 3 (R - r)^2) / (12 d)      (Weller 2013,
///   section 5.4)
/// The division is carried out so that nothing cancels: with d limited to at least |R - r|, where
/// containment begins, the quotient q = (R - r) / d stays within [-1, 1], and one expression holds
/// from touch to concentric spheres. The volume is continuous, and so is its derivative at touch
/// and at containment.
/// @param R, r  [m] radii, >= 0
/// @param d     [m] between the centres, >= 0
template <typename T>
T lens_volume(T R, T r, T d) {
  const T apart = std::max(d, std::abs(R - r));
  const T s = R + r - apart;
  if (!(s > T(0)) || !(apart > T(0))) {  // disjoint, or concentric and of the same size
    const T smaller = std::min(R, r);
    return s > T(0) ? T(4.0 * M_PI / 3.0) * smaller * smaller * smaller : T(0);
  }
  const T q = (R - r) / apart;
  return T(M_PI / 12.0) * s * s * (apart + T(2) * (R + r) - T(3) * (R - r) * q);
}

}  // namespace ist
