#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/robot/robot_description.h"

namespace ist {

/// Where every joint's child link is in its parent link.
struct JointPoses {
  std::vector<Eigen::Isometry3d> X_PC;  ///< by joint: child link -> parent link; valid where known
  std::vector<bool> known;              ///< by joint
};

/// Forward kinematics of a URDF's tree, in double.
///
/// Revolute, continuous and prismatic joints have one position [rad, m]. A mimic joint takes its
/// position from the joint it follows, through any number of others, never a position of its own.
/// Planar and floating joints cannot be told by one number: their poses are the caller's to fill
/// in (from tf, say); until then nothing is known of the links below them.
/// Immutable; const members are thread safe.
class Kinematics {
 public:
  /// @throws ModelError naming the joint: an axis of length 0, numbers that are not finite, mimic
  ///         joints that follow one another in a ring, or one that is not there or has no position
  explicit Kinematics(const RobotDescription& description);

  struct Joint {
    std::string name;
    JointType type;
    std::size_t parent, child;  ///< links
    Eigen::Isometry3d X_PJ;     ///< joint frame J -> parent link
    Eigen::Vector3d axis;       ///< unit, in J
    double lower, upper;        ///< [rad, m] limits, may be infinite
    std::size_t source;         ///< joint whose position moves this one; itself unless it mimics
    double multiplier, offset;  ///< of the source's position, over the whole chain of mimics

    /// Whether it takes a position of its own.
    bool is_free() const;
    /// Planar or floating.
    bool has_unstated_pose() const {
      return type == JointType::kPlanar || type == JointType::kFloating;
    }
  };

  /// Names; the root first, every link after its parent.
  const std::vector<std::string>& links() const { return links_; }
  /// Joint j moves link j + 1.
  const std::vector<Joint>& joints() const { return joints_; }
  std::optional<std::size_t> find_link(const std::string& name) const;
  std::optional<std::size_t> find_joint(const std::string& name) const;

  /// X_PC of one joint at position q [rad, m] of its own; q is ignored where the joint is fixed.
  /// Not for planar and floating joints.
  Eigen::Isometry3d joint_pose(std::size_t joint, double q) const;

  /// Poses of all joints that positions can tell.
  /// @param q      by joint, NaN where not known; read for free joints only
  /// @param poses  overwritten; planar and floating joints are not known
  void place_joints(const std::vector<double>& q, JointPoses* poses) const;

  /// Poses of all links.
  /// @param X_FR   root link -> fixed frame
  /// @param X_FL   by link
  /// @param known  by link: false below a joint that is not known
  void place_links(const JointPoses& poses, const Eigen::Isometry3d& X_FR,
                   std::vector<Eigen::Isometry3d>* X_FL, std::vector<bool>* known) const;

  /// The joint nearest to the root, on the way to `link`, whose pose is not known.
  std::optional<std::size_t> first_unknown(const JointPoses& poses, std::size_t link) const;

 private:
  void add_tree(const RobotDescription& description);
  void resolve_mimics(const RobotDescription& description);

  std::vector<std::string> links_;
  std::vector<Joint> joints_;
};

}  // namespace ist
