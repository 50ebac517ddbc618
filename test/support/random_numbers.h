#pragma once

#include <Eigen/Geometry>
#include <cstddef>

#include "support/scene.h"

namespace ist::test {

/// 10 to a power that is uniform from low to high.
double power_of_ten(Rng* rng, double low, double high);

inline bool chance(Rng* rng, double probability) { return uniform(rng, 0.0, 1.0) < probability; }

/// A whole number from 0 to count - 1.
std::size_t below(Rng* rng, std::size_t count);

/// A motion by 10 nm to 10^largest metres.
Eigen::Isometry3d small_motion(Rng* rng, double largest);

}  // namespace ist::test
