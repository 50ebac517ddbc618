#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <ros/time.h>

#include <cstddef>
#include <vector>

namespace ist {

/// The gaps between transforms of a frame in which nobody knows its pose, which tf2 interpolates
/// all the same: the publisher was silent, and the frame is elsewhere afterwards. Not thread safe.
class TransformGaps {
 public:
  struct Gap {
    ros::Time begin, end;  ///< stamps of the transforms about it
  };

  /// Notes a transform with a stamp; they come in any order.
  /// @param longest  [s] what is farther apart is a gap
  /// @param kept     [s] older gaps are forgotten
  void note(const geometry_msgs::TransformStamped& transform, double longest, double kept);

  /// The gap that holds an instant; null: none does.
  const Gap* find(const ros::Time& instant) const;
  std::size_t size() const { return gaps_.size(); }

 private:
  struct Pause {
    geometry_msgs::TransformStamped before, after;
  };

  void add_if_long(const Pause& pause, double longest);

  geometry_msgs::TransformStamped newest_;
  std::vector<Pause> pauses_;  ///< all that are long; a transform that comes late may divide one
  std::vector<Gap> gaps_;      ///< those in which the frame has moved
};

}  // namespace ist
