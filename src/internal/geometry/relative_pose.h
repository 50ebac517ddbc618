#pragma once

#include <Eigen/Geometry>

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

}  // namespace ist
