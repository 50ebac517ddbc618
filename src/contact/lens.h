#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

namespace ist {

/// The lens that two spheres of radii R and r share, or the smaller sphere where the other one
/// contains it; one pair of spheres for each lane of an Eigen array. Its volume is
///   V = pi / 12 * thickness^2 * factor  [m^3].
/// This is V = pi (R + r - d)^2 (d^2 + 2 d (R + r) - 3 (R - r)^2) / (12 d) (Weller 2013, section
/// 5.4), divided out so that nothing cancels: from d = |R - r| inward the smaller sphere is
/// contained, so with d no less than that the quotient q = (R - r) / d stays within [-1, 1], and
/// one expression holds from touch to concentric spheres. Continuous, with a continuous slope at
/// touch and at containment.
template <typename Lanes>
struct Lens {
  using Scalar = typename Lanes::Scalar;

  /// @param sum         [m] R + r
  /// @param difference  [m] R - r
  /// @param distance    [m] d, between the centres, >= 0
  Lens(const Lanes& sum, const Lanes& difference, const Lanes& distance) {
    const Lanes d = distance.max(difference.abs());
    thickness = (sum - d).max(Scalar(0));
    const Lanes q = difference / d.max(std::numeric_limits<Scalar>::min());
    factor = d + Scalar(2) * sum - Scalar(3) * difference * q;
  }

  Lanes thickness;  ///< [m] along the line of the centres; 0 where the spheres are apart
  Lanes factor;     ///< [m]
};

/// The position of the lens's middle on the line from the centre of sphere R (0) to that of sphere
/// r (1): the middle of its thickness, and the smaller sphere's centre where the other one contains
/// it. As a point it is continuous in both spheres.
template <typename Lanes>
Lanes lens_middle(const Lanes& difference, const Lanes& distance) {
  using Scalar = typename Lanes::Scalar;
  constexpr Scalar kTiny = std::numeric_limits<Scalar>::min();
  return ((distance + difference) / (Scalar(2) * distance).max(kTiny))
      .max(Scalar(0))
      .min(Scalar(1));
}

/// [m^3] The lens's volume for one pair of spheres.
/// @param R, r  [m] radii, >= 0
/// @param d     [m] between the centres, >= 0
template <typename T>
T lens_volume(T R, T r, T d) {
  if (!(d > T(0)) && R == r) return T(4.0 * M_PI / 3.0) * r * r * r;
  using One = Eigen::Array<T, 1, 1>;
  const Lens<One> lens(One::Constant(R + r), One::Constant(R - r), One::Constant(d));
  const T s = lens.thickness.value();
  return T(M_PI / 12.0) * s * s * lens.factor.value();
}

}  // namespace ist
