#include "support/random_numbers.h"

#include <algorithm>
#include <cmath>

namespace ist::test {

double power_of_ten(Rng* rng, double low, double high) {
  return std::pow(10.0, uniform(rng, low, high));
}

std::size_t below(Rng* rng, std::size_t count) {
  return std::min(count - 1,
                  static_cast<std::size_t>(uniform(rng, 0.0, static_cast<double>(count))));
}

Eigen::Isometry3d small_motion(Rng* rng, double largest) {
  const double size = power_of_ten(rng, -8.0, largest);
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() =
      Eigen::AngleAxisd(uniform(rng, 0.0, 5.0) * size, random_vector(rng, 1.0).normalized())
          .toRotationMatrix();
  X.translation() = random_vector(rng, size);
  return X;
}

}  // namespace ist::test
