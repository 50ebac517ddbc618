#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace ist {

/// [m^3] Volume of all points within `radius` of a box that is not empty (Steiner's formula).
inline double rounded_box_volume(const Eigen::Vector3d& sizes, double radius) {
  const double x = sizes.x(), y = sizes.y(), z = sizes.z();
  return x * y * z + 2.0 * radius * (x * y + y * z + z * x) + M_PI * radius * radius * (x + y + z) +
         4.0 / 3.0 * M_PI * radius * radius * radius;
}

/// The share that a part of a volume is of the whole, at least: 0 to just below 1. Rounding of sums
/// in single precision is allowed for.
/// @param part  [m^3] that is known
/// @param rest  [m^3] that there is besides, at most; infinity: nobody knows
inline double known_share(double part, double rest) {
  constexpr double kRounding = 1.001, kNearlyAll = 0.999;
  if (!(part > 0.0)) return 0.0;
  return std::min(part / (kRounding * (part + std::max(rest, 0.0))), kNearlyAll);
}

/// The least upper bound so far of a volume of which a part is known, so that the share that is
/// known never falls while bounds of whole groups are replaced by those of their members.
class VolumeBound {
 public:
  /// @param part, rest  [m^3] as for known_share()
  void tighten(double part, double rest) { whole_ = std::min(whole_, part + std::max(rest, 0.0)); }
  double known_share(double part) const { return ist::known_share(part, whole_ - part); }

 private:
  double whole_ = std::numeric_limits<double>::infinity();  ///< [m^3]
};

}  // namespace ist
