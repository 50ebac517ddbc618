#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {

/// Where the links are at one common instant.
struct StampedLinkPoses : LinkPoses {
  ros::Time stamp;                    ///< that instant; the present one when no link is known
  std::vector<std::string> problems;  ///< by link: why not; empty where known or not wanted

  /// Every one of `links` unknown, without a problem.
  void reset(const ros::Time& now, std::size_t links);
  /// Says why no link can be known.
  void blame(const std::vector<bool>& wanted, const std::string& problem);
  std::size_t count_known() const;
};

/// Where the robot's links come from: tf, or the node's own kinematics. Not thread safe; never
/// waits.
class PoseSource {
 public:
  virtual ~PoseSource() = default;

  /// @param now  of the ROS clock; 0 (no clock yet) makes every link unknown
  virtual void look_up(const ros::Time& now, StampedLinkPoses* poses) = 0;

  /// Where all bodies of the robot are, links without geometry too, at the instant of the last
  /// look_up(): what a Jacobian needs.
  /// @param instant  the stamp that look_up() gave
  virtual void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                           BodyPoses* bodies) = 0;

  /// For a person whose links have no pose: what may be missing.
  virtual std::string hint() const = 0;
};

}  // namespace ist
