#pragma once

#include <Eigen/Geometry>
#include <cmath>

namespace ist {

/// X_AB from two poses in a frame F. Translations are subtracted before they are rotated, so that
/// no precision is lost where both are far from F's origin.
inline Eigen::Isometry3d relative_pose(const Eigen::Isometry3d& X_FA,
                                       const Eigen::Isometry3d& X_FB) {
  Eigen::Isometry3d X_AB;
  X_AB.linear() = X_FA.linear().transpose() * X_FB.linear();
  X_AB.translation() = X_FA.linear().transpose() * (X_FB.translation() - X_FA.translation());
  X_AB.makeAffine();
  return X_AB;
}

/// A rigid pose, and how far the one that was given is from it.
struct RigidPose {
  Eigen::Isometry3d X;
  double drift = 0.0;  ///< see nearest_rigid()
};

/// Replaces a linear part R that is nearly a rotation by the nearest rotation Q: two Newton steps
/// of the polar decomposition (Higham, Functions of Matrices, 8.3). The singular values of R are
/// those of Q, which are 1, to drift / 2, where drift is the Frobenius norm of R^T R - I. So the
/// spectral norm of R - Q is no larger than that, nor is that of the difference of their inverses,
/// but for its square. Queries take the transpose for the inverse in many places; after this step
/// it is. A pose that is a rotation in double is not changed, nor one that is none at all.
inline RigidPose nearest_rigid(const Eigen::Isometry3d& X) {
  constexpr double kRounding = 1e-14, kNoRotation = 0.1;
  RigidPose rigid{X, 0.0};
  for (int step = 0; step < 3; ++step) {
    const Eigen::Matrix3d excess =
        rigid.X.linear().transpose() * rigid.X.linear() - Eigen::Matrix3d::Identity();
    const double drift = excess.norm();
    if (step == 0) rigid.drift = drift;
    if (!(drift > kRounding && drift < kNoRotation)) break;
    rigid.X.linear() -= 0.5 * rigid.X.linear() * excess;
  }
  return rigid;
}

/// [m] Distances to a link in a pose that is not quite rigid, or to a point that the transpose or
/// the inverse of that pose takes to the link's frame, differ from those in the nearest rigid pose
/// by no more than this.
/// @param extent    [m] no point of the link is farther from its origin
/// @param distance  [m] to the link
inline double pose_error(double drift, double extent, double distance) {
  return 0.5 * (1.0 + 10.0 * drift) * drift * (extent + std::abs(distance));
}

}  // namespace ist
