#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/geometry/relative_pose.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/known_world.h"

namespace ist {

/// An object at its pose.
struct PosedObject {
  const KnownWorld::Object* object = nullptr;  ///< owned by its world
  std::uint32_t world = 0, index = 0;          ///< its world, and its place there
  RigidPose X_FO;
  Eigen::Vector3d center_F, half;  ///< [m] of its box, whose axes are those of O
  double radius = 0.0;             ///< [m] of the sphere about its box
  double extent = 0.0;             ///< [m] no point of it is farther from O's origin

  void place(const Eigen::Isometry3d& X_FO_given);
};

/// Objects that stand near each other in one frame B, at the pose of that frame.
struct ObjectGroup {
  std::uint32_t world = 0;             ///< their world
  std::size_t frame = 0;               ///< index in its frames()
  std::size_t first = 0, last = 0;     ///< PosedObjects::objects[first] to [last - 1]
  bool is_placed = false;              ///< its objects are
  bool has_moved = false;              ///< with its frame, in the last PosedObjects::take()
  Eigen::Vector3d center_B;            ///< [m] of a sphere about their boxes
  double radius_B = 0.0;               ///< [m] of that sphere
  double extent = 0.0;                 ///< [m] no point is farther from its object's origin
  double drift_B = 0.0, margin = 0.0;  ///< [m] the largest of their poses and of their margins
  Eigen::Vector3d center_F;            ///< [m] of a sphere about the placed objects
  double radius = 0.0;                 ///< [m] of that sphere; inf: it is not known
  double drift = 0.0;                  ///< of no object is it larger

  void place(const Eigen::Isometry3d& X_FB);
  /// [m] No point of its objects moves farther when the frame's pose becomes another one.
  double moves_at_most(const Eigen::Isometry3d& X_FB, const Eigen::Isometry3d& X_FB_next) const;
};

/// All objects of a query. Those of a group are placed when a link first comes near to it, so that
/// a world may be large.
class PosedObjects {
 public:
  /// Takes worlds that are placed. Allocates where they are others than the last ones.
  /// @param given  with the worlds' poses of now
  /// @returns whether they are others
  bool take(Span<const PosedWorld* const> given);
  /// Places the objects of a group, where they are not.
  void place(ObjectGroup* group);

  const std::vector<PosedObject>& objects() const { return objects_; }  ///< group by group
  std::vector<ObjectGroup>& groups() { return groups_; }
  double path() const { return path_; }  ///< [m] no object has moved farther, all motions added
  /// Another one whenever the objects are others, or the path is counted anew.
  std::uint64_t generation() const { return generation_; }
  std::size_t placements() const { return placements_; }  ///< since the last take()

 private:
  void list(std::uint32_t world);
  void close(ObjectGroup* group) const;
  void move(Span<const PosedWorld* const> given);

  std::vector<PosedWorld> worlds_;
  std::vector<PosedObject> objects_;
  std::vector<ObjectGroup> groups_;
  double path_ = 0.0;
  std::uint64_t generation_ = 0;
  std::size_t placements_ = 0;
};

}  // namespace ist
