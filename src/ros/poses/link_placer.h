#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Turns the poses of joints into the poses of the links that a query needs. Not thread safe.
class LinkPlacer {
 public:
  /// @param links  names, in the order of StampedLinkPoses
  LinkPlacer(std::shared_ptr<const Kinematics> kinematics, const std::vector<std::string>& links);

  std::size_t size() const { return index_.size(); }  ///< number of links in StampedLinkPoses

  /// Makes every body unknown.
  void reset();

  /// @param joints          poses of all joints
  /// @param X_FR            root link -> fixed frame
  /// @param wanted          by link: false leaves it unknown, without a problem
  /// @param joint_problems  by joint: why its pose is not known
  /// @param poses           receives the links; its stamp stays
  void place(const JointPoses& joints, const Eigen::Isometry3d& X_FR,
             const std::vector<bool>& wanted, const std::vector<PoseProblem>& joint_problems,
             StampedLinkPoses* poses);

  /// The result of the last place().
  const BodyPoses& bodies() const { return bodies_; }

 private:
  std::shared_ptr<const Kinematics> kinematics_;
  std::vector<std::size_t> index_;  ///< by link: its body; else the number of bodies
  BodyPoses bodies_;
};

}  // namespace ist
