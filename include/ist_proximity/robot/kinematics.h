#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// Poses of all joints' child bodies in their parent bodies, by joint of the kinematics.
struct JointPoses {
  std::vector<Eigen::Isometry3d> X_PC;  ///< child body -> parent body; valid where known
  std::vector<bool> known;              ///< by joint: whether its pose is known
};

/// Poses of all bodies, by body of the kinematics. LinkPoses (link_poses.h) are by link of a model.
struct BodyPoses {
  std::vector<Eigen::Isometry3d> X_FB;  ///< body frame -> fixed frame; valid where known
  std::vector<bool> known;              ///< by body: whether its pose is known
};

/// Forward kinematics of a URDF's tree, in double.
///
/// A body is a link of the URDF, with geometry or without; "link" is kept for the links of a
/// RobotModel, which are some of the bodies and have their own order.
///
/// Revolute, continuous and prismatic joints have one position [rad, m]. A mimic joint takes its
/// position from the joint it follows, through any number of others, unless its own is stated.
/// One number does not determine the pose of a planar or floating joint: the caller fills it in
/// (from tf, for example); until then the bodies below such a joint are not known.
/// Immutable; const members are thread safe.
class Kinematics {
 public:
  /// @throws ModelError naming the joint: an axis of length 0, numbers that are not finite, mimic
  ///         joints that follow one another in a ring, or one that is not there or has no position
  explicit Kinematics(const RobotDescription& description);

  /// A joint between two bodies.
  struct Joint {
    std::string name;        ///< name in the URDF
    JointType type;          ///< kind of the joint
    std::size_t parent;      ///< index of the parent body
    std::size_t child;       ///< index of the child body, which the joint moves
    Eigen::Isometry3d X_PJ;  ///< joint frame J -> parent body
    Eigen::Vector3d axis;    ///< unit, in J
    double lower;            ///< [rad, m] limit, may be -inf
    double upper;            ///< [rad, m] limit, may be +inf
    double speed;            ///< [rad/s, m/s] limit, may be +inf
    std::size_t source;      ///< joint whose position moves this one; itself unless it mimics
    double multiplier;       ///< factor of the source's position, over the whole chain of mimics
    double offset;           ///< [rad, m] added to that product
    std::size_t leader;      ///< joint that its mimic element names; itself unless it mimics
    Mimic mimic;             ///< how it follows that one

    /// Whether it takes a position of its own.
    bool is_free() const;
    /// [rad, m] From one position to another; a continuous joint turns the shorter way round.
    double way(double from, double to) const;
    /// Planar or floating.
    bool has_unstated_pose() const {
      return type == JointType::kPlanar || type == JointType::kFloating;
    }
  };

  /// Names; the root first, every body after its parent.
  const std::vector<std::string>& bodies() const { return bodies_; }
  /// Joint j moves body j + 1.
  const std::vector<Joint>& joints() const { return joints_; }
  /// By body: whether the description gives it geometry of its own, attached objects aside. What
  /// cannot be read counts.
  const std::vector<bool>& has_geometry() const { return has_geometry_; }
  /// @returns the body's index; empty when no body has this name
  std::optional<std::size_t> find_body(const std::string& name) const;
  /// @returns the joint's index; empty when no joint has this name
  std::optional<std::size_t> find_joint(const std::string& name) const;

  /// The mimic joints, every one after its leader.
  const std::vector<std::size_t>& mimics() const { return mimics_; }
  /// Places the mimic joints that are not stated where their leaders put them.
  /// @param q  [rad, m] by joint; NaN where it is not stated, or not known afterwards
  void place_mimics(std::vector<double>* q) const;

  /// X_PC of one joint at position q [rad, m] of its own; q is ignored where the joint is fixed.
  /// Not for planar and floating joints.
  Eigen::Isometry3d joint_pose(std::size_t joint, double q) const;

  /// Poses of all joints that positions determine.
  /// @param q      by joint, NaN where not known; a mimic joint at NaN follows the nearest joint of
  ///               its chain that is not. With another size no joint is known
  /// @param poses  overwritten; planar and floating joints are not known
  void place_joints(const std::vector<double>& q, JointPoses* poses) const;

  /// Poses of all bodies. A body below a joint that is not known is not known.
  /// @param joints  of this kinematics; with other sizes no body is known
  /// @param X_FR    root body -> fixed frame
  /// @param poses   overwritten
  void place_bodies(const JointPoses& joints, const Eigen::Isometry3d& X_FR,
                    BodyPoses* poses) const;

  /// The joint nearest to the root, between root and `body`, whose pose is not known.
  std::optional<std::size_t> first_unknown(const JointPoses& poses, std::size_t body) const;

 private:
  void add_tree(const RobotDescription& description);
  void resolve_mimics(const RobotDescription& description);
  std::size_t followed_joint(const JointDescription& joint) const;
  double led_position(const std::vector<double>& q, std::size_t joint) const;

  std::vector<std::string> bodies_;
  std::vector<bool> has_geometry_;
  std::vector<Joint> joints_;
  std::unordered_map<std::string, std::size_t> body_of_name_, joint_of_name_;
  std::vector<std::size_t> mimics_;
};

/// Linear velocity [m/s] over angular velocity [rad/s], per joint.
using Jacobian = Eigen::Matrix<double, 6, Eigen::Dynamic>;

/// The geometric Jacobian of a point P that is fixed to a body: with the joints moving at dq
/// [rad/s, m/s], J * dq is the velocity of P in the fixed frame, over the body's angular velocity;
/// and J^T * (force; torque about P) are the joints' efforts [N m, N].
///
/// It needs the bodies' poses alone: a joint's axis is fixed in its child body and goes through
/// that body's origin. No joint position is needed, so poses from tf serve as well.
/// @param X_FB  by body (BodyPoses): body frame -> fixed frame; read for the child bodies of the
///              moving joints between root and `body`, see first_body_needed
/// @param p_FP  [m] in the fixed frame
/// @param body  with no such body, or as many poses as there are not, J is NaN
/// @param J     overwritten; one column per joint of the kinematics. A mimic joint's motion is in
///              the column of the joint that it follows; columns of joints that are not free, or do
///              not move the body, are zero. Planar and floating joints have no column: they count
///              as standing still. Allocates when it has another size than before.
/// Thread safe.
void point_jacobian(const Kinematics& kinematics, Span<const Eigen::Isometry3d> X_FB,
                    std::size_t body, const Eigen::Vector3d& p_FP, Jacobian* J);

/// The body whose pose point_jacobian() would read although it is not known: the nearest to `body`
/// between it and the root, itself included. Empty when all poses that it reads are known.
/// @param known  by body
std::optional<std::size_t> first_body_needed(const Kinematics& kinematics,
                                             const std::vector<bool>& known, std::size_t body);

}  // namespace ist
