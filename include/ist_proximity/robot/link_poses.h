#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/geometry/region_of_interest.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/kinematics.h"
#include "ist_proximity/robot/robot_model.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Poses of a robot model's links, by link of the model: what every query takes.
struct LinkPoses {
  std::vector<Eigen::Isometry3d> X_FL;  ///< link frame -> fixed frame; valid where known
  std::vector<bool> known;              ///< by link: whether its pose is known
};

/// Forward kinematics of a model's links. A link that the URDF lacks, or that is below a joint
/// whose pose is not known, is not known. Allocates; ForwardKinematics is for loops.
/// @param kinematics  of the description that the model was built from
/// @param q           [rad, m] by joint of the kinematics, NaN where not known; a mimic joint at
/// NaN
///                    follows its source
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

/// By link of a model: whether the link may move in the frame of a body of the URDF, because a
/// joint that is not fixed is between them. True for links that the kinematics lacks, and for all
/// links where it lacks the body. Thread safe.
std::vector<bool> links_that_move(const RobotModel& model, const Kinematics& kinematics,
                                  const std::string& body);

/// A link at a pose, as Ingest takes it for its self-filter.
/// @param link  viewed by the result, which must not outlive it
/// @param X_FL  link frame -> fixed frame, rigid
PosedSolid posed_solid(const LinkModel& link, const Eigen::Isometry3d& X_FL);

/// The links of a robot at their poses, as Ingest takes them for its self-filter. Links of unknown
/// pose, with an error or without spheres are left out.
/// @param model  viewed by the result, which must not outlive it
/// @param X_FL   by link: link frame -> fixed frame, rigid where known; a link beyond the end of
///               this or of `known` is of unknown pose
/// @param known  by link: whether the pose is known
std::vector<PosedSolid> posed_solids(const RobotModel& model, Span<const Eigen::Isometry3d> X_FL,
                                     const std::vector<bool>& known);

/// The same, appended to `solids`: allocates nothing where its capacity is enough. Several calls
/// collect a robot at several instants.
void append_posed_solids(const RobotModel& model, Span<const Eigen::Isometry3d> X_FL,
                         const std::vector<bool>& known, std::vector<PosedSolid>* solids);

/// The kinematic reach of a robot: the radius of a sphere about the root link's origin that holds
/// the robot in every configuration. It bounds the workspace from outside by the sum of the lengths
/// along each chain of joints.
/// @param model  of the same description
/// @returns [m] no part of a usable link is ever farther from the root link's origin, whatever the
///          positions of revolute and continuous joints, and while prismatic ones keep to their
///          limits; +inf where joints are planar, floating or slide without limits. Thread safe.
double kinematic_reach(const RobotModel& model, const Kinematics& kinematics);

/// The robot's region of interest: a sphere about the root link's origin, in the fixed frame, of
/// the kinematic reach and the range of queries. Points outside it are discarded; no link can come
/// near them. The radius is infinite where the fixed frame is not a link that stands still in the
/// root link (the robot as a whole may then go anywhere), and where the reach is not bounded.
/// Thread safe.
/// @param model  of the same description
/// @param range  [m] how far from a link obstacles matter: max_distance of the queries
RegionOfInterest region_of_interest(const RobotModel& model, const Kinematics& kinematics,
                                    const std::string& fixed_frame, double range);

}  // namespace ist
