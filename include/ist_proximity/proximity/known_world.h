#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// An object of a known world as it is described: a wall, a table, a link of another robot.
struct WorldObject {
  std::string name;       ///< not empty; another object of the same name is replaced
  std::string frame;      ///< name of the frame B that it stands still in
  LinkGeometry geometry;  ///< its elements, in the object's frame O; the solid is their union
  Eigen::Isometry3d X_BO = Eigen::Isometry3d::Identity();  ///< object frame O -> B, rigid
  double margin = 0.0;  ///< [m] subtracted from the lower bounds of distances to it; 0 to 10 km
  std::vector<std::string> allowed_links;  ///< links that may touch it: no distance between them
};

/// Limits of a known world. A box takes about 15 kB, a mesh about 500 bytes for each triangle.
struct WorldLimits {
  std::size_t max_objects = 10000;      ///< and shapes of all objects together
  std::size_t max_triangles = 2000000;  ///< of all objects; a box has 12
};

/// The shape of an object, ready for queries.
struct WorldShape;
class ShapeCache;

/// The objects of one source, ready for queries. Immutable, thread safe, shared by pointer.
class KnownWorld {
 public:
  /// One object. Copies share its shape.
  struct Object {
    std::string name;                                        ///< unique
    std::size_t frame = 0;                                   ///< its frame B: index in frames()
    Eigen::Isometry3d X_BO = Eigen::Isometry3d::Identity();  ///< object frame O -> B
    double margin = 0.0;                                     ///< [m]
    std::vector<std::string> allowed_links;                  ///< links that may touch it
    std::shared_ptr<const LinkGeometry> geometry;            ///< in O
    std::shared_ptr<const WorldShape> shape;                 ///< what queries need, in O
    std::uint64_t id = 0;  ///< another one for each shape; the same when the object is moved
  };

  /// All objects of the world.
  const std::vector<Object>& objects() const { return objects_; }
  /// Names of the frames that objects stand in, each once.
  const std::vector<std::string>& frames() const { return frames_; }

  /// The world of the objects in some of the frames, where others are not known. It has all frames.
  /// @param frames  by frame, whether its objects stay
  std::shared_ptr<const KnownWorld> in_frames(const std::vector<bool>& frames) const;

 private:
  friend class WorldBuilder;
  std::vector<Object> objects_;
  std::vector<std::string> frames_;
};

/// A known world and where its frames are at one instant.
struct PosedWorld {
  std::shared_ptr<const KnownWorld> world;  ///< null: nothing is there
  std::vector<Eigen::Isometry3d> X_FB;      ///< by frame of the world: B -> fixed frame, rigid
};

/// Why an object cannot be used.
struct WorldFault {
  std::string object;  ///< its name; empty: all that were to be added
  std::string text;    ///< a sentence that names it
};

/// Makes known worlds, object by object. Objects that do not change are shared by all worlds that
/// are made. One thread, also for a builder and its copies.
class WorldBuilder {
 public:
  /// @param limits  of the worlds that it makes
  explicit WorldBuilder(const WorldLimits& limits = {});

  /// Adds objects; one takes the place of another of the same name. It builds their hierarchies and
  /// packs them coarsely: some milliseconds for a box or a cylinder, none for a sphere, up to a
  /// second for 10^5 triangles. Objects of equal geometry share it, and what is known is not
  /// built again.
  /// @param cancelled  asked now and then; true ends the work, and nothing is added. May be empty
  /// @returns one fault for each object that cannot be used; an older one of that name stays. Where
  ///          a limit is exceeded, the only fault says so and nothing is added
  std::vector<WorldFault> add(const std::vector<WorldObject>& objects,
                              const std::function<bool()>& cancelled = {});

  /// Moves an object, which keeps its shape.
  /// @returns empty, or why it is not moved
  std::string move(const std::string& name, const std::string& frame,
                   const Eigen::Isometry3d& X_BO);
  /// @returns false when there is no such object
  bool remove(const std::string& name);
  void clear();                                         ///< removes all objects
  std::size_t size() const { return entries_.size(); }  ///< objects
  /// Whether there is an object of this name.
  bool contains(const std::string& name) const { return entries_.count(name) > 0; }

  /// The world of the objects of now.
  std::shared_ptr<const KnownWorld> world() const;

 private:
  struct Entry {
    KnownWorld::Object object;  ///< `frame` is not set
    std::string frame;
    std::size_t triangles = 0;
  };
  std::string exceeded_limit(const std::vector<WorldObject>& objects) const;
  void insert(const WorldObject& object, const std::shared_ptr<const LinkGeometry>& geometry,
              const std::shared_ptr<const WorldShape>& shape);

  WorldLimits limits_;
  std::shared_ptr<ShapeCache> shapes_by_geometry_;  ///< copies of this share it
  std::map<std::string, Entry> entries_;            ///< by name
  std::size_t triangles_ = 0, shapes_ = 0;
};

}  // namespace ist
