#pragma once

#include <ist_proximity/QueryProximity.h>

#include <memory>
#include <vector>

#include "ist_proximity/proximity/time_of_self_impact.h"
#include "ist_proximity/robot/link_poses.h"
#include "ros/model/model_state.h"
#include "ros/parameters/parameters.h"
#include "ros/poses/stated_pose_source.h"

namespace ist {

/// The part of ~query's answers that is about link against link. It makes its queries when it is
/// first asked. One thread.
class SelfQueryAnswer {
 public:
  explicit SelfQueryAnswer(ServerConfig config) : config_(std::move(config)) {}

  /// Takes a model that is ready and has kinematics.
  void set_model(const std::shared_ptr<const ModelState>& model);

  /// Chooses the pairs of the next answers.
  /// @param chosen  by monitored link: pairs need one of them
  void choose(const std::vector<bool>& chosen);
  std::size_t size() const { return pairs_.size(); }  ///< pairs that were chosen

  /// Appends the distances of the chosen pairs in the configuration that was stated.
  /// @param poses  its last look_up() was of that configuration
  void add(const StatedPoseSource& poses, const QueryConfig& query,
           std::vector<ist_proximity::LinkPairProximity>* answers);

  /// Begins a motion.
  void begin_motion();
  /// Goes on with a straight part of it.
  /// @param start  [s] when the part begins
  /// @param still  poses of joints that do not move; not known while the root link has no pose
  void advance(const JointMotion& motion, double start, const JointPoses& still,
               const QueryConfig& query);
  /// By chosen pair [s]: when the links first touch, as in impact_times.
  const std::vector<double>& impact_times() const { return first_; }

 private:
  const ServerConfig config_;
  std::shared_ptr<const ModelState> model_;
  std::unique_ptr<ForwardKinematics> forward_;
  std::unique_ptr<SelfQuery> query_;           ///< of the watched pairs; null until it is needed
  std::unique_ptr<TimeOfSelfImpact> impacts_;  ///< the same
  std::vector<std::size_t> pairs_;             ///< chosen, by place among the watched ones
  std::vector<bool> wanted_;                   ///< by watched pair: no contact was found yet
  std::vector<double> first_;
  std::vector<PairProximity> results_;
};

}  // namespace ist
