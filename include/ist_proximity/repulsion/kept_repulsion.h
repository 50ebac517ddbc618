#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>

#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// One link's blended repulsion from cycle to cycle, computed anew only when it may have changed by
/// something that matters.
///
/// The blend is continuous in the link's pose. While the clouds and the maps' poses are the same,
/// and no point of the link has moved by more than kKeptMotion of the smoothing since the blend was
/// computed (1 mm with the default), its direction is kept, and so is its torque per length. The
/// length follows the distance at once. So the steps of the direction are no larger than those that
/// a motion of that size makes, as a fast robot makes it from one cycle to the next. Errors do not
/// add up. One thread.
class KeptRepulsion {
 public:
  /// In units of the smoothing.
  static constexpr double kKeptMotion = 0.01;

  /// @param link  index in the model that the repulsion was made with
  KeptRepulsion(const RobotModel& model, std::size_t link);

  /// @param end  when a new blend has to end
  /// The others are as for Repulsion::wrench().
  /// @returns as Repulsion::wrench(). Allocates nothing
  RepulsiveWrench update(const Repulsion& repulsion, const Eigen::Isometry3d& X_FL,
                         SnapshotSpan clouds, const LinkProximity& proximity,
                         const RepulsionConfig& config, TimePoint end = TimePoint::max());

  /// The next update() computes the blend.
  void forget() { is_kept_ = false; }

 private:
  double moved(const Eigen::Isometry3d& X_FL) const;

  std::size_t link_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();  ///< [m] of the bounding sphere, link frame
  double radius_ = 0.0;                               ///< [m]

  // The last blend.
  bool is_kept_ = false;
  Eigen::Isometry3d X_FL_ = Eigen::Isometry3d::Identity();
  std::uint64_t obstacles_ = 0;  ///< key of the clouds, and of the places of maps
  double smoothing_ = 0.0;       ///< [m]
  RepulsiveWrench per_length_;
};

}  // namespace ist
