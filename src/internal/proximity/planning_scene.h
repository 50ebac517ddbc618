#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "ist_proximity/cloud/octree.h"
#include "ist_proximity/geometry/shapes.h"
#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/known_world.h"

/// moveit_msgs/PlanningScene, read from its bytes, so that the package of that message is not
/// needed.
namespace ist {

/// The layouts of moveit_msgs/CollisionObject that publishers have.
enum class SceneLayout {
  kShapePoses,  ///< to moveit_msgs 0.10 (Indigo to Melodic): shapes have poses, objects have none
  kObjectPose   ///< from moveit_msgs 0.11 (Noetic): shapes stand in an object's pose; subframes
};

/// The layout of a message whose definition has this md5sum; none: it is not known.
std::optional<SceneLayout> scene_layout(const std::string& md5sum);

/// A moveit_msgs/CollisionObject.
struct SceneObject {
  /// The operation on the object of this name, with the message's numbers.
  enum class Operation : std::uint8_t { kAdd, kRemove, kAppend, kMove };

  SceneLayout layout = SceneLayout::kObjectPose;
  std::string id;
  std::string frame;  ///< of the header; may be empty
  Operation operation = Operation::kAdd;
  bool has_pose = false;  ///< whether the pose is stated: not the identity, and not 0
  Eigen::Isometry3d X_BP = Eigen::Isometry3d::Identity();  ///< the object's pose P -> frame B
  LinkGeometry geometry;                                   ///< its shapes, in P
  std::vector<Eigen::Isometry3d> X_PS;  ///< poses of shapes; of kMove there may be poses alone
  std::string fault;                    ///< why it cannot be used; empty: it can
};

/// A moveit_msgs/AllowedCollisionMatrix.
struct AllowedCollisions {
  std::vector<std::string> names;             ///< of links and objects; empty: not stated
  std::vector<std::vector<bool>> is_allowed;  ///< by two indices of names

  /// Names that may touch `name`, other than those of which `is_left_out` is true.
  std::vector<std::string> allowed_with(
      const std::string& name, const std::function<bool(const std::string&)>& is_left_out) const;
};

/// A moveit_msgs/AttachedCollisionObject: an object that a scene attaches to a link of the robot,
/// or detaches from it.
struct SceneAttachment {
  std::string link;                      ///< of a detachment (kRemove) it may be empty: any
  std::vector<std::string> touch_links;  ///< links that it may touch, besides `link`
  /// The object. Of a detachment its name may be empty: any. Without shapes it is the object of
  /// this name in the scene's world.
  SceneObject object;
};

/// The octomap of a scene (octomap_msgs/OctomapWithPose).
struct SceneOctomap {
  std::string frame;                                       ///< B, of the outer header; may be empty
  Eigen::Isometry3d X_BM = Eigen::Isometry3d::Identity();  ///< the map's frame M -> frame B
  Octree tree;                                             ///< in M; no leaf: none, or cleared
  std::string fault;                                       ///< why it cannot be used; empty: it can
};

/// The part of a moveit_msgs/PlanningScene that is read.
struct PlanningScene {
  bool is_diff = false;              ///< whether objects that it does not name stay
  std::vector<SceneObject> objects;  ///< in the order of the message
  bool has_matrix = false;           ///< whether a matrix is stated, even if it is not used
  AllowedCollisions allowed;
  std::vector<SceneAttachment> attachments;  ///< in the order of the message
  /// Whether objects that earlier scenes have attached stay so.
  bool keeps_attached = false;
  /// Whether `octomap` takes the place of that of earlier scenes, also where it is empty.
  bool sets_octomap = false;
  SceneOctomap octomap;
  /// Why parts of it are not used: a matrix that is too large or not square. Sentences.
  std::vector<std::string> notes;
  std::string fault;  ///< why nothing of it can be used; empty: it can
};

/// The objects that scenes have attached to links of the robot. A difference that does not name
/// them does not end them.
class AttachedObjects {
 public:
  /// An object of a scene is one of the world by its own name, and attached by this one, so that
  /// both may be there.
  static std::string name_in_world(const std::string& id) { return id + " (attached)"; }

  /// @param most  attached objects that are kept
  explicit AttachedObjects(std::size_t most) : most_(most) {}

  /// Notes that an object is attached, in place of one of the same name.
  /// @returns false where there are too many
  bool attach(const SceneAttachment& attachment);
  /// Ends the attachments that a detachment means.
  /// @returns the names of their objects
  std::vector<std::string> detach(const SceneAttachment& attachment);
  void clear() { attached_.clear(); }  ///< detaches all of them

  bool contains(const std::string& id) const { return attached_.count(id) > 0; }
  std::vector<std::string> names() const;  ///< of all of them
  /// The links that an attached object may touch: its own, and those that were named.
  std::vector<std::string> touched_by(const std::string& id) const;
  /// @returns what is not measured of them, a sentence; empty: none is attached
  std::string sentence() const;

 private:
  struct Attached {
    std::string link;
    std::vector<std::string> touch_links;
  };
  std::size_t most_;
  std::map<std::string, Attached> attached_;  ///< by name of the object
};

/// Reads a message.
/// @param limits  more objects, shapes or triangles are a fault, found before memory is taken for
///                them. What is kept takes at most 200 bytes for each byte of the message
/// @param octomap  the same of the scene's octomap; a larger one is a fault of the octomap alone
PlanningScene read_planning_scene(Span<const std::uint8_t> bytes, SceneLayout layout,
                                  const WorldLimits& limits = {}, const OctreeLimits& octomap = {});

/// Whether a scene removes the octomap by the name that it has among MoveIt's objects.
bool removes_octomap(const PlanningScene& scene);

/// The object that kAdd, or kAppend to none, adds. Where one shape alone has a pose, it becomes the
/// object's, as MoveIt does it, so that the object can be moved.
/// @param default_frame  where the message names none
WorldObject to_world_object(const SceneObject& object, const std::string& default_frame);

/// Adds the shapes of kAppend to an object, if they stand in the same frame at the same pose.
/// @returns empty, or why they cannot be added
std::string append_shapes(const SceneObject& object, const std::string& default_frame,
                          WorldObject* known);

/// Finds the pose that kMove gives to an object. Where it states poses of shapes, these must be
/// those of the object moved as a whole.
/// @param X_BO  set unless there is a fault
/// @returns empty, or why it cannot be moved
std::string moved_pose(const SceneObject& object, const WorldObject& known,
                       Eigen::Isometry3d* X_BO);

}  // namespace ist
