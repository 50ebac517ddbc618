#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "ist_proximity/geometry/span.h"

namespace ist {

/// Notices when obstacles are at other places. One thread; allocates where there are more places.
class PlaceMotion {
 public:
  /// @param X_FB      places of the obstacles; the first ones are no motion
  /// @param time      [s] at which they are there
  /// @param is_other  whether the obstacles are others, which counts as motion
  void note(Span<const Eigen::Isometry3d> X_FB, double time, bool is_other) {
    const auto is_same = [](const Eigen::Isometry3d& one, const Eigen::Isometry3d& other) {
      return one.matrix() == other.matrix();
    };
    if (key_ > 0 && !is_other &&
        std::equal(X_FB_.begin(), X_FB_.end(), X_FB.begin(), X_FB.end(), is_same)) {
      return;
    }
    if (key_ > 0 || is_other) moved_ = time;
    ++key_;
    X_FB_.assign(X_FB.begin(), X_FB.end());
  }

  /// Another one for each time at which they have moved.
  std::uint64_t key() const { return key_; }
  /// Also where the clock has gone back since.
  bool stands_still(double time) const { return std::abs(time - moved_) > kStandsStill; }

 private:
  static constexpr double kStandsStill = 1.0;  ///< [s] without motion

  std::uint64_t key_ = 0;
  double moved_ = -1e300;  ///< [s] when they did last
  std::vector<Eigen::Isometry3d> X_FB_;
};

}  // namespace ist
