#pragma once

#include <ros/time.h>

#include <cstddef>
#include <memory>
#include <vector>

#include "ist_proximity/control/constraint_rows.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/kinematics.h"
#include "ros/model/model_state.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Links that joints move whose newest positions are older than the poses' instant. One thread.
class LateJoints {
 public:
  /// @param kinematics  null: no joint is late
  /// @param boxes       by link of the robot; outlives this
  LateJoints(std::shared_ptr<const Kinematics> kinematics, const std::vector<LinkBox>& boxes);

  /// [m] By link: how far its points may have moved from those positions until the instant. Empty:
  /// no joint is late. Valid until the next call.
  /// @param source   after its look_up(); may be null
  /// @param instant  of the poses
  /// @param known    by link: whether it has a pose
  Span<const double> update(PoseSource* source, const ros::Time& instant,
                            const std::vector<bool>& known);
  /// [m] The same, of the last update().
  Span<const double> moved() const {
    return lags_.empty() ? Span<const double>() : Span<const double>(moved_);
  }

  /// [m] How much nearer to each other two links of the robot may have come since: joints that move
  /// both alike do not count. Of the last update().
  double approach(std::size_t first, std::size_t second);

 private:
  const std::shared_ptr<const Kinematics> kinematics_;
  const std::vector<LinkBox>& boxes_;
  std::vector<std::size_t> links_;  ///< by link: its body; 0: no joint moves it
  BodyPoses bodies_;
  std::vector<StoppingReach> lags_, own_;  ///< by joint; of approach(): of one link's alone
  std::vector<double> moved_;
};

}  // namespace ist
