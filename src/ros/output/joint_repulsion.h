#pragma once

#include <ist_proximity/JointRepulsion.h>
#include <ist_proximity/ProximityArray.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/repulsion/repulsion.h"
#include "ist_proximity/robot/jacobian.h"
#include "ros/model/model_loader.h"
#include "ros/poses/pose_source.h"

namespace ist {

/// Sums the repulsion of all monitored links in the robot's joints. One thread.
class JointRepulsion {
 public:
  /// @param model  ready
  explicit JointRepulsion(const ModelState& model);

  /// @param source     (null: there is none, the kinematics is faulty) whose last look_up() gave
  /// the poses that the pushes belong to
  /// @param pushes     by link of the robot
  /// @param proximity  with the same poses: header and status
  /// @param message    overwritten
  void fill(PoseSource* source, const std::vector<RepulsiveWrench>& pushes,
            const ist_proximity::ProximityArray& proximity, ist_proximity::JointRepulsion* message);

 private:
  /// Empty, or why the Jacobian cannot be known.
  std::string add(std::size_t place, const RepulsiveWrench& push);
  void blame(std::size_t place);

  std::shared_ptr<const Kinematics> kinematics_;  ///< null where the URDF's is faulty
  std::string problem_;                           ///< of the kinematics
  std::vector<std::size_t> monitored_;            ///< links of the robot
  std::vector<std::size_t> places_;               ///< of those: their bodies

  // Of this call, by body and by joint.
  BodyPoses bodies_;
  Eigen::VectorXd effort_;
  Jacobian J_;
};

}  // namespace ist
