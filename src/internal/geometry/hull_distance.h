#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>

#include "internal/geometry/hull_coreset.h"

namespace ist {

/// Up to four corners of the difference A - B of two point sets, and the weights that give the
/// point of their hull that is nearest to the origin.
struct DifferenceSimplex {
  struct Corner {
    Eigen::Vector3d w, on_a, on_b;  ///< [m] w = on_a - on_b
    std::uint32_t a, b;             ///< points of A and B, by index
  };
  std::array<Corner, 4> corner;
  std::array<double, 4> weight;
  std::size_t size = 0;

  Eigen::Vector3d nearest() const;  ///< [m] of the hull of w, to the origin
  Eigen::Vector3d on_a() const;     ///< [m]
  Eigen::Vector3d on_b() const;     ///< [m]

  /// Leaves out the corners without weight at the point that is nearest to the origin. All four
  /// stay where they hold the origin.
  void reduce();
};

/// The pairs of points on which the search for the distance of two hulls ended, to start the next
/// one with. Any pairs will do.
struct HullSupport {
  std::array<std::uint32_t, 4> a{}, b{};
  std::size_t size = 0;
};

/// The distance of two convex hulls.
struct HullDistance {
  /// [m] Proven for the surfaces themselves, errors of the coresets included, along `direction`; 0
  /// or less: nothing is proven.
  double lower_bound = 0.0;
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit, in B's frame, from B to A
  /// [m] In B's frame: points of the hulls, which need not be of the surfaces.
  Eigen::Vector3d on_a = Eigen::Vector3d::Zero(), on_b = Eigen::Vector3d::Zero();
};

/// The distance of the hulls of two surfaces by GJK (Gilbert, Johnson and Keerthi 1988) over their
/// coresets, neither empty.
/// @param X_BA       A's frame -> B's, rigid
/// @param precision  [m] the search may end where it is this near to the distance
/// @param support    of the last search, or none; replaced by that of this one
/// @param enough     [m] the search may end where the lower bound is this, or cannot become it
HullDistance hull_distance(const HullCoreset& a, const HullCoreset& b,
                           const Eigen::Isometry3d& X_BA, double precision, HullSupport* support,
                           double enough = 0.0);

}  // namespace ist
