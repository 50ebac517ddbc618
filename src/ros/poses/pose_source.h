#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/link_poses.h"

namespace ist {

/// The poses of the links at one common instant.
struct StampedLinkPoses : LinkPoses {
  ros::Time stamp;                    ///< that instant; now when no link is known
  std::vector<std::string> problems;  ///< by link: why it is not known; else empty

  /// Makes every link unknown, without a problem.
  void reset(const ros::Time& now, std::size_t links);
  /// Gives every wanted link the same problem.
  void set_problem(const std::vector<bool>& wanted, const std::string& problem);
  std::size_t count_known() const;
};

/// A source of link poses: tf, or the node's own kinematics. Not thread safe; never waits.
class PoseSource {
 public:
  virtual ~PoseSource() = default;

  /// Looks up the poses of all wanted links.
  /// @param now  the ROS clock's time; 0 (no clock yet) makes every link unknown
  virtual void look_up(const ros::Time& now, StampedLinkPoses* poses) = 0;

  /// Looks up the poses of all bodies of the robot, links without geometry too, at the instant of
  /// the last look_up(). Jacobians need them.
  /// @param instant  the stamp that look_up() gave
  virtual void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                           BodyPoses* bodies) = 0;

  /// Names a likely cause for the user whose links have no pose.
  virtual std::string hint() const = 0;
};

}  // namespace ist
