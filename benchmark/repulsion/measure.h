#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/robot/robot_model.h"
#include "repulsion/scene.h"

namespace ist::benchmark {

/// How a vector changes along a motion, step by step.
struct Noise {
  /// [deg] per step, where the vector is long enough before and after: all, and out of contact.
  std::vector<double> angles, free_angles;
  std::vector<double> lengths, free_lengths;  ///< change of length per step, of the range
  std::size_t short_steps = 0;                ///< where it is not long enough, though not zero
  double variation = 0.0;  ///< [deg] of the direction in all, along the steps of the reference

  /// @param is_free       whether the link is out of contact
  /// @param in_reference  whether this step counts for `variation`
  void add(const Eigen::Vector3d& before, const Eigen::Vector3d& now, bool is_free,
           bool in_reference);
};

/// Shorter than this, of the range, a direction means nothing: obstacles push from both sides.
constexpr double kShort = 0.05;

/// [m] Another smoothing than the default.
constexpr double kNarrow = 0.05;

/// The measurements of one scene at one resolution.
struct Measured {
  Noise nearest, blend, narrow;      ///< narrow: the blend with kNarrow for smoothing
  Noise wrench;                      ///< its force, of each link's largest along the motion
  double reference_variation = 0.0;  ///< [deg] from exact geometry
  double wrench_reference_variation = 0.0;
  std::vector<double> query_us, blend_us;  ///< of one link within the influence distance
  std::vector<double> half, twice;         ///< change of the blend, of the gain
  std::vector<double> narrow_half, narrow_twice;
};

/// @param bodies  by link, for the wrench
Measured measure(const MovingScene& scene, const std::shared_ptr<const RobotModel>& model,
                 const std::vector<std::shared_ptr<const ContactGeometry>>& bodies);

/// Variation of the direction [deg] along the reference steps, from exact geometry: the same blend
/// over dense samples of the links' exact surfaces, in double, pair by pair.
/// @param counts  by step of the reference and link: whether the step to it counts
double reference_variation(const MovingScene& scene, const std::vector<std::vector<bool>>& counts);

/// The same of the wrench's force: the way in at each thinned point inside the link, by its depth
/// as the wrench counts points. Depths are those of the exact solids; the way in is the mean over
/// dense samples of the exact surface, as ContactGeometry defines it.
double wrench_reference_variation(const MovingScene& scene, const RobotModel& model,
                                  const std::vector<std::vector<bool>>& counts);

}  // namespace ist::benchmark
