#pragma once

#include <ist_proximity/JointRepulsion.h>
#include <ist_proximity/ProximityArray.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>

#include <chrono>
#include <functional>

#include "ros/output/markers.h"
#include "ros/output/speed_scale_publisher.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Publishes the results of a cycle: ~proximity, ~joint_repulsion, ~min_distance, ~speed_scale and
/// ~markers. One thread.
class ResultPublisher {
 public:
  ResultPublisher(ros::NodeHandle private_nh, const ServerConfig& config);

  /// The summary of the whole robot's distances.
  SpeedScalePublisher& summary() { return summary_; }
  /// Sets which links count, in the summary and as the nearest one of the markers.
  /// @param self  the same in ~self_proximity
  void set_links(const CountedLinks& links, const CountedLinks& self) {
    summary_.set_links(links, self);
    marker_drawer_.set_counts(links.counts);
  }

  /// @param self                  the newest ~self_proximity; may be null
  /// @param speed_scale           its present configuration
  /// @param fill_joint_repulsion  fills the message for the same result; called only while the
  /// topic
  ///                              has subscribers, because Jacobians cost time
  /// @param scene                 in the fixed frame; called only while markers are drawn
  /// @returns whether markers were drawn
  bool publish(const ist_proximity::ProximityArrayConstPtr& result,
               const ist_proximity::ProximityArrayConstPtr& self,
               const SpeedScaleConfig& speed_scale,
               const std::function<void(ist_proximity::JointRepulsion*)>& fill_joint_repulsion,
               const std::function<MarkerScene()>& scene);

 private:
  ros::Publisher proximity_, joint_repulsion_, markers_;
  SpeedScalePublisher summary_;
  ProximityMarkers marker_drawer_;
  std::chrono::steady_clock::time_point next_markers_;
};

}  // namespace ist
