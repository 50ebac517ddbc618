#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <vector>

#include "ist_proximity/repulsion/repulsion.h"
#include "repulsion/blend_kernel.h"
#include "repulsion/coarse_spheres.h"

namespace ist {

/// A link's blend at one pose, and its first-order Taylor expansion about that pose.
///
/// The sums over a sphere's pairs are expanded in the displacement of the sphere's centre, and in
/// that of the nearest pair's distance, which is the least of the spheres' own nearest distances.
/// The slopes take neighbouring points for one: they are some percent off, for which
/// remaining_error() allows.
class BlendExpansion {
 public:
  /// A mean over pairs is `wrench` over `weight`.
  struct Sums {
    RepulsiveWrench wrench;
    double weight = 0.0;
  };

  /// Starts anew.
  void begin(const std::vector<SphereGroup>& groups, const Eigen::Isometry3d& X_FL);
  /// @param R_FO  axes of the index that the points are of, in the fixed frame
  void add(const NearestPoints& points, const Eigen::Matrix3d& R_FO);
  /// @param has_slopes  whether they are known; where they are not, the sums do not change
  void add(const SphereSums& sums, const Eigen::Matrix3d& R_FO, bool has_slopes);
  /// @param nearest  [m] distance of the nearest pair
  void end(const Sums& sums, double nearest);

  /// Whether there is a blend.
  bool empty() const { return !(sums_.weight > 0.0); }

  /// The sums at another pose.
  /// @param error     [m] an error of the expansion as large as if the spheres had moved by this
  /// @param farthest  [m] no sphere may have moved farther
  /// @returns whether the error is no larger. Not where the pose is NaN
  bool find(const Eigen::Isometry3d& X_FL, double error, double farthest, Sums* sums) const;

 private:
  using Slots = Eigen::Array<float, static_cast<int>(kCoarseSpheres), 1>;
  struct Vectors {
    Slots x = Slots::Zero(), y = Slots::Zero(), z = Slots::Zero();
  };

  Vectors times(const Eigen::Matrix3f& A, const Vectors& v) const;
  double remaining_error(const Slots& moved) const;
  float change_of_nearest(const Vectors& moved) const;

  Eigen::Isometry3d X_FL_ = Eigen::Isometry3d::Identity();
  Vectors p_LC_;  ///< [m] centres; slots without a sphere repeat one
  // As in SphereSums and NearestPoints; vectors and matrices in the fixed frame.
  Slots weight_ = Slots::Zero(), weight_slope_ = Slots::Zero(), per_length_ = Slots::Zero();
  Slots distance_ = Slots::Zero();
  Vectors force_, slope_;
  Vectors outer_, outer_mixed_;  ///< diagonal, and the elements xy, yz and zx
  Vectors toward_;               ///< unit vectors from the nearest point to the centre
  Sums sums_;
  float nearest_ = 0.0F;  ///< [m]
  bool has_slopes_ = false;
};

}  // namespace ist
