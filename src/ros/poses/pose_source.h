#pragma once

#include <ros/time.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"

namespace ist {

/// The poses of the links at one common instant.
struct LinkPoses {
  ros::Time stamp;                      ///< that instant; now when no link is known
  std::vector<Eigen::Isometry3d> X_FL;  ///< by link: link frame -> fixed frame; valid where known
  std::vector<bool> known;              ///< by link
  std::vector<std::string> problems;    ///< by link: why it is not known; else empty

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
  virtual void look_up(const ros::Time& now, LinkPoses* poses) = 0;

  /// Looks up the poses of all links at the instant of the last look_up(), links without geometry
  /// too. Jacobians need them.
  /// @param instant  the stamp that look_up() gave
  /// @param X_FL     by link of the kinematics: link frame -> fixed frame; valid where known
  /// @param known    by link of the kinematics
  virtual void look_up_all(const Kinematics& kinematics, const ros::Time& instant,
                           std::vector<Eigen::Isometry3d>* X_FL, std::vector<bool>* known) = 0;

  /// Names a likely cause for the user whose links have no pose.
  virtual std::string hint() const = 0;
};

}  // namespace ist
