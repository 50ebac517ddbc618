#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Tells whether clouds are the ones of the query before: what was proven among them still holds.
class SeenClouds {
 public:
  /// @returns a number that stays the same from call to call as long as all clouds do; 0 where
  ///          there are more of them than are remembered.
  std::uint64_t note(SnapshotSpan clouds);

 private:
  struct Seen {
    std::uint64_t points = 0, boxes = 0;  ///< build ids; 0: there are none
    Eigen::Matrix<double, 3, 4> X_FM = Eigen::Matrix<double, 3, 4>::Zero();  ///< of the boxes
  };
  static constexpr std::size_t kMost = 16;
  static Seen look(const CloudSnapshot& cloud);

  std::array<Seen, kMost> seen_;
  std::size_t count_ = 0;
  std::uint64_t number_ = 0;
};

/// BoundingSphere all of a link, and of what it encloses, in its own frame [m].
Eigen::AlignedBox3d box_of(const LinkModel& link);

/// Where a link's parts are: a box in its own frame.
///
/// A point of the link is an affine function of the pose, so what it goes from one pose to another
/// is a convex function of where on the link it is: none goes farther than the farthest corner.
class LinkExtent {
 public:
  explicit LinkExtent(const LinkModel& link);

  /// [m] No point of the link, nor of what it encloses, is farther between the two poses. NaN if
  /// either is.
  double motion(const Eigen::Isometry3d& X_FA, const Eigen::Isometry3d& X_FB) const;

 private:
  Eigen::Vector3d center_, half_;  ///< [m] of the box, link frame
  double size_;                    ///< [m] no coordinate of the box is larger
};

/// A lower bound of a link's distance, proven at one pose, that holds at others: less the way from
/// the one to the other. It stays where it was proven, so ways do not add up.
///
/// A solid is a set of points, each of which goes no farther than that. The inside of a mesh with
/// holes ends where no surface is: a point outside may then be inside, and its distance jump to
/// less than nothing, after a way as short as you like. But the spheres leave no inside beyond
/// InnerSphereTree::interior_gap(), and a point that is known to stay farther from them stays
/// outside.
class CarriedBound {
 public:
  explicit CarriedBound(const LinkModel& link);

  /// @param clouds  by SeenClouds; 0: nothing is carried
  /// @param bound   [m] of the distance to the stored points
  /// @param beyond  [m] no point is nearer to the spheres, or what planes of the link leave of them
  void prove(std::uint64_t clouds, const Eigen::Isometry3d& X_FL, double bound, double beyond);
  void forget() { clouds_ = 0; }

  /// [m] No point is nearer to the link at this pose; -inf: nothing is known.
  double at(std::uint64_t clouds, const Eigen::Isometry3d& X_FL) const;

  /// [m] from where the bound was proven; NaN or inf: there is none.
  double motion(std::uint64_t clouds, const Eigen::Isometry3d& X_FL) const;

 private:
  LinkExtent extent_;
  double least_beyond_;  ///< [m] what `beyond` has to stay above
  std::uint64_t clouds_ = 0;
  Eigen::Isometry3d X_FL_ = Eigen::Isometry3d::Identity();
  double bound_ = 0.0, beyond_ = 0.0;
};

}  // namespace ist
