#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/contact/contact_model.h"
#include "ist_proximity/robot/robot_model.h"
#include "repulsion/scene.h"

namespace ist::benchmark {

/// Changes of a vector along a motion, step by step.
struct Noise {
  /// [deg] per step, if the vector is long enough before and after: all steps, and those without
  /// contact.
  std::vector<double> angles, free_angles;
  std::vector<double> lengths, free_lengths;  ///< change of length per step, of the range
  std::size_t short_steps = 0;  ///< steps with a vector that is too short, but not zero
  double variation = 0.0;       ///< [deg] sum over the steps of the reference

  /// @param is_free       whether the link is out of contact
  /// @param in_reference  whether this step counts for `variation`
  void add(const Eigen::Vector3d& before, const Eigen::Vector3d& now, bool is_free,
           bool in_reference);
};

/// A shorter vector, as a share of the range, has no meaningful direction: obstacles push from both
/// sides.
constexpr double kShort = 0.05;

/// [m] A narrower smoothing than the default.
constexpr double kNarrow = 0.05;

/// Measurements of one scene at one resolution.
struct Measured {
  Noise nearest, blend, narrow;  ///< narrow: the blend with the smoothing kNarrow
  Noise wrench;                  ///< its force, relative to each link's largest along the motion
  double reference_variation = 0.0;  ///< [deg] from exact geometry
  double wrench_reference_variation = 0.0;
  std::vector<double> query_us, blend_us;  ///< of one link within the influence distance
  std::vector<double> half, twice;         ///< change of the blend, relative to the gain
  std::vector<double> narrow_half, narrow_twice;
};

/// @param bodies  by link, for the wrench
Measured measure(const MovingScene& scene, const std::shared_ptr<const RobotModel>& model,
                 const std::vector<std::shared_ptr<const ContactBody>>& bodies);

/// Variation of the direction [deg] along the reference steps, from exact geometry: the same blend
/// over dense samples of the links' exact surfaces, in double, pair by pair.
/// @param counts  by step of the reference and link: whether the step to it counts
double reference_variation(const MovingScene& scene, const std::vector<std::vector<bool>>& counts);

/// The same for the wrench's force: the inward direction at each thinned point inside the link,
/// weighted by its depth as in the wrench. Depths are those of the exact solids. The inward
/// direction is the mean over dense samples of the exact surface, as ContactBody defines it.
double wrench_reference_variation(const MovingScene& scene, const RobotModel& model,
                                  const std::vector<std::vector<bool>>& counts);

}  // namespace ist::benchmark
