#pragma once

#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "ist_proximity/proximity/time_of_impact.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Conservative time of impact of links of one robot with one another along a joint motion.
///
/// Conservative advancement (Mirtich 1996), as TimeOfImpact does with obstacles: two links that are
/// proven to be d or more apart cannot touch before their points have moved by d in all. Points
/// move in the frame of the nearest body that both links hang on, so that joints which carry both
/// do not count. Distances are lower bounds of SelfQuery, margin included, so no contact comes
/// before the time that is returned. The search ends where the bound is below 1 um: along glancing
/// motions that may be long before a contact, or without one. One object per thread.
class TimeOfSelfImpact {
 public:
  /// Builds a SelfQuery of the pairs, which see.
  /// @param config  max_distance and margin are read: the time is that of a distance of `margin`
  TimeOfSelfImpact(std::shared_ptr<const RobotModel> model,
                   std::shared_ptr<const Kinematics> kinematics, std::vector<LinkPair> pairs,
                   const QueryConfig& config);
  ~TimeOfSelfImpact();
  TimeOfSelfImpact(TimeOfSelfImpact&&) noexcept;
  TimeOfSelfImpact& operator=(TimeOfSelfImpact&&) noexcept;

  /// @param motion   sizes as the kinematics' joints
  /// @param still    poses of joints that the motion does not move; planar and floating ones too
  /// @param wanted   by pair: false skips the pair, and its time is NaN
  /// @param results  by pair, overwritten; a time is NaN where a joint between the links is not
  ///                 known, and every time is where the sizes of the other arguments differ or the
  ///                 duration is not finite and more than 0
  void run(const JointMotion& motion, const JointPoses& still, const std::vector<bool>& wanted,
           std::vector<ImpactTime>* results);

  /// Takes effect at the next run().
  void set_config(const QueryConfig& config);

  const std::vector<LinkPair>& pairs() const;  ///< the ones given to the constructor

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
