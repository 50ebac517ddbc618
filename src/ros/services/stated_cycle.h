#pragma once

#include <ist_proximity/ProximityArray.h>
#include <sensor_msgs/JointState.h>

#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/proximity/time_of_impact.h"
#include "ros/add_ons/add_on.h"
#include "ros/cycle/proximity_cycle.h"
#include "ros/poses/stated_pose_source.h"

namespace ist {

/// Queries of configurations that the robot need not be in, and of motions that begin there,
/// against the obstacles of now. It has a cycle of its own, so that it never delays the node's. One
/// thread.
class StatedCycle {
 public:
  StatedCycle(const AddOnContext& node, StatedPoseSource::Stamp stamp)
      : node_(node), stamp_(stamp) {}

  /// Takes the newest model.
  /// @returns empty, or why there is none
  std::string take_model();

  /// Measures one configuration; joints that it leaves out are where they are now.
  /// @param live  its deadline counts
  /// @returns empty, or why the configuration cannot be taken
  std::string run(const sensor_msgs::JointState& configuration, const LiveConfig& live,
                  ist_proximity::ProximityArray* result);

  /// Makes times of impact ready for the obstacles of the last run(). Those in late frames may have
  /// come nearer meanwhile.
  TimeOfImpact& impacts(const QueryConfig& query);
  /// By link of the robot: whether a motion that begins at the last run() can be answered.
  std::vector<bool> measurable() const;

  // Valid after take_model().
  const std::shared_ptr<const ModelState>& model() const { return model_; }
  StatedPoseSource& poses() const { return *poses_; }
  const ProximityCycle& cycle() const { return *cycle_; }

 private:
  const AddOnContext node_;
  const StatedPoseSource::Stamp stamp_;

  std::shared_ptr<const ModelState> model_;
  StatedPoseSource* poses_ = nullptr;  ///< owned by the cycle
  std::unique_ptr<ProximityCycle> cycle_;
  std::unique_ptr<TimeOfImpact> impacts_;
  double reach_ = 0.0;  ///< [m] of the robot
};

}  // namespace ist
