#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <memory>

#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

/// One link's blended repulsion from cycle to cycle, computed anew only when it may have changed by
/// something that matters.
///
/// The blend is continuous in the link's pose. While the clouds and the maps' poses are the same,
/// and the link has moved little since its blend was computed, the blend follows the link's motion
/// by its first-order Taylor expansion, and its length follows the distance at once. How far off
/// the expansion may be is bounded in terms of a motion: never more than the direction changes
/// where a link moves by kKeptMotion of the smoothing (1 mm with the default), as a fast robot does
/// from one cycle to the next; where the vector is short, by that over its length per gain. Beside
/// maps there is no expansion: the direction is kept as it is, with the same bound. Errors do not
/// add up. One thread.
class KeptRepulsion {
 public:
  /// In units of the smoothing: the error that is allowed.
  static constexpr double kKeptMotion = 0.01;
  /// The same: no sphere of the link moves farther before the blend is computed anew.
  static constexpr double kMostKeptMotion = 0.08;

  /// @param link  index in the model that the repulsion is made with
  explicit KeptRepulsion(std::size_t link);
  ~KeptRepulsion();
  KeptRepulsion(KeptRepulsion&&) noexcept;
  KeptRepulsion& operator=(KeptRepulsion&&) noexcept;

  /// The arguments are those of Repulsion::wrench(). Allocates nothing.
  /// @param end  when a new blend has to end
  /// @returns as Repulsion::wrench()
  RepulsiveWrench update(const Repulsion& repulsion, const Eigen::Isometry3d& X_FL,
                         SnapshotSpan clouds, const LinkProximity& proximity,
                         const RepulsionConfig& config, TimePoint end = TimePoint::max());

  /// The next update() computes the blend.
  void forget() { is_kept_ = false; }

 private:
  std::size_t link_;

  // The last blend.
  bool is_kept_ = false;
  std::uint64_t obstacles_ = 0;  ///< key of the clouds, and of the places of maps
  double smoothing_ = 0.0;       ///< [m]
  std::unique_ptr<BlendExpansion> blend_;
};

}  // namespace ist
