#pragma once

#include <ist_proximity/ProximityArray.h>
#include <ist_proximity/SpeedScaleState.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/time.h>

#include <set>
#include <string>

#include "ist_proximity/proximity/speed_scale.h"
#include "ros/model/counted_links.h"
#include "ros/parameters/parameters.h"

namespace ist {

/// Publishes what the whole robot's distances come to: ~min_distance, ~speed_scale and
/// ~speed_scale_state, at every cycle. With ~self_collision/in_minimum the newest ~self_proximity
/// counts as well, and nothing is known without one that is fresh. One thread.
class SpeedScalePublisher {
 public:
  SpeedScalePublisher(ros::NodeHandle private_nh, const ServerConfig& config);

  /// Sets the links of the messages to come; hysteresis starts again where their names are others.
  /// @param self  of ~self_proximity
  void set_links(const CountedLinks& links, const CountedLinks& self);
  /// Forgets what hysteresis holds, after a jump of the clock.
  void forget() { scale_.reset(); }

  /// @param result  of the cycle; with other links than set_links() has stated, nothing is known
  /// @param self    the newest ~self_proximity; null: none yet, or not enabled
  /// @param now     the ROS clock's time
  /// @param reach   by link of `result`, see SpeedScaleInput; empty: not known
  void publish(const ist_proximity::ProximityArray& result,
               const ist_proximity::ProximityArray* self, const SpeedScaleConfig& config,
               const ros::Time& now, Span<const StoppingReach> reach);

  // The result of the last publish(), for the diagnostics.
  double min_distance() const { return min_distance_; }  ///< [m] NaN: not known
  /// With ~self_collision/in_minimum: why ~self_proximity cannot be used; else empty.
  const std::string& self_problem() const { return self_problem_; }
  /// The scale, and the link and the rule that decide, as a sentence. Empty: not enabled.
  std::string summary() const;

 private:
  bool is_usable(const ist_proximity::ProximityArray& result) const;
  bool is_fresh(const ist_proximity::ProximityArray* self, const ros::Time& now) const;
  void find_scale(const ist_proximity::ProximityArray& result,
                  const ist_proximity::ProximityArray* self, const SpeedScaleConfig& config,
                  const ros::Time& now, Span<const StoppingReach> reach);
  double oldest_age(const ist_proximity::ProximityArray& result, const ros::Time& now) const;
  void fill_state(const ist_proximity::ProximityArray& result, const SpeedScaleConfig& config,
                  ist_proximity::SpeedScaleState* state) const;

  const bool is_enabled_;
  const bool self_counts_;
  const double pose_timeout_;          ///< [s]
  std::set<std::string> never_stale_;  ///< names of sources that stand still
  ros::Publisher min_publisher_, scale_publisher_, state_publisher_;
  CountedLinks links_, self_links_;
  SpeedScale scale_;
  SpeedScaleAnswer answer_;
  bool is_reach_known_ = true;  ///< of the link that decides
  /// The message that holds the link that decides; null: none does. Valid within publish().
  const ist_proximity::ProximityArray* decisive_ = nullptr;
  std::string self_problem_;  ///< why distances from link to link are not known; else empty
  double min_distance_;
};

}  // namespace ist
