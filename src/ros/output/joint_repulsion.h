#pragma once

#include <ist_proximity/JointRepulsion.h>
#include <ist_proximity/ProximityArray.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/kinematics.h"
#include "ros/model/model_state.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Sums the repulsion of all monitored links as efforts of the robot's joints: J^T (force; torque).
/// One thread.
class JointRepulsion {
 public:
  /// @param model  ready
  explicit JointRepulsion(const ModelState& model);

  /// @param source   its last look_up() gave the poses of the repulsion; null where the kinematics
  ///                 is faulty
  /// @param pushes   repulsion by link of the robot
  /// @param message  has the stamp and the status of ~proximity for these poses; receives the
  ///                 efforts, and where an OK is none for them, why
  void fill(PoseSource* source, const std::vector<RepulsiveWrench>& pushes,
            ist_proximity::JointRepulsion* message);

 private:
  /// Adds the efforts of one link.
  /// @param body  the link in the kinematics
  /// @returns empty, or why the Jacobian cannot be known
  std::string add(std::size_t body, const RepulsiveWrench& push);
  void set_unknown(std::size_t body);

  std::shared_ptr<const Kinematics> kinematics_;  ///< null where the URDF's is faulty
  std::string problem_;                           ///< the sentence where kinematics_ is null
  std::vector<std::size_t> links_;                ///< indices of links of the robot
  std::vector<std::size_t> index_;                ///< their bodies

  // Valid for one call, by body and by joint of the kinematics.
  BodyPoses bodies_;
  Eigen::VectorXd effort_;
  Jacobian J_;
};

}  // namespace ist
