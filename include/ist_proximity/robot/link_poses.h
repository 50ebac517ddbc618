#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Poses of a robot model's links, by link of the model: what every query takes.
struct LinkPoses {
  std::vector<Eigen::Isometry3d> X_FL;  ///< link frame -> fixed frame; valid where known
  std::vector<bool> known;              ///< by link: whether its pose is known
};

/// Forward kinematics of a model's links. A link that the URDF lacks, or that is below a joint
/// whose pose is not known, is not known. Allocates; ForwardKinematics is for loops.
/// @param kinematics  of the description that the model was built from
/// @param q           [rad, m] by joint of the kinematics, NaN where not known; read for free
///                    joints only
/// @param X_FR        root link -> fixed frame
LinkPoses link_poses(const RobotModel& model, const Kinematics& kinematics,
                     const std::vector<double>& q,
                     const Eigen::Isometry3d& X_FR = Eigen::Isometry3d::Identity());

/// The same, for many configurations: reuses its memory, so that from its second run() on it
/// allocates nothing. One object per thread.
class ForwardKinematics {
 public:
  /// @param model       read by the constructor only
  /// @param kinematics  of the description that the model was built from
  ForwardKinematics(const RobotModel& model, std::shared_ptr<const Kinematics> kinematics);

  /// @param q, X_FR  as for link_poses()
  /// @returns valid until the next run()
  const LinkPoses& run(const std::vector<double>& q,
                       const Eigen::Isometry3d& X_FR = Eigen::Isometry3d::Identity());

  /// The same for poses of joints, planar and floating ones included.
  const LinkPoses& run(const JointPoses& joints,
                       const Eigen::Isometry3d& X_FR = Eigen::Isometry3d::Identity());

  const LinkPoses& links() const { return links_; }    ///< of the last run()
  const BodyPoses& bodies() const { return bodies_; }  ///< of the last run(), for Jacobians
  const Kinematics& kinematics() const {
    return *kinematics_;
  }  ///< the one given to the constructor

  /// The body that is a link of the model; none where the URDF lacks the link.
  const std::optional<std::size_t>& body(std::size_t link) const { return body_of_link_[link]; }

 private:
  std::shared_ptr<const Kinematics> kinematics_;
  std::vector<std::optional<std::size_t>> body_of_link_;
  JointPoses joints_;
  BodyPoses bodies_;
  LinkPoses links_;
};

}  // namespace ist
