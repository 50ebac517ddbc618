#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>

#include "support/scene.h"

namespace ist::test {

/// 10 to a power that is uniform from low to high.
inline double power_of_ten(Rng* rng, double low, double high) {
  return std::pow(10.0, uniform(rng, low, high));
}

inline bool chance(Rng* rng, double probability) { return uniform(rng, 0.0, 1.0) < probability; }

/// A whole number from 0 to count - 1.
inline std::size_t below(Rng* rng, std::size_t count) {
  return std::min(count - 1,
                  static_cast<std::size_t>(uniform(rng, 0.0, static_cast<double>(count))));
}

/// A motion by 10 nm to 10^largest metres.
inline Eigen::Isometry3d small_motion(Rng* rng, double largest) {
  const double size = power_of_ten(rng, -8.0, largest);
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() =
      Eigen::AngleAxisd(uniform(rng, 0.0, 5.0) * size, random_vector(rng, 1.0).normalized())
          .toRotationMatrix();
  X.translation() = random_vector(rng, size);
  return X;
}

}  // namespace ist::test
