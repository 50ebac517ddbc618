#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/packing/packing.h"
#include "ist_proximity/robot/robot_description.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

class DistanceField;

/// One monitored link, ready for queries.
struct LinkModel {
  std::string name;      ///< name in the URDF
  std::string error;     ///< not empty: no geometry, the link is always UNKNOWN
  Packing packing;       ///< of the whole link, in the link's frame
  InnerSphereTree tree;  ///< over the spheres of `packing`
  Solid solid;           ///< the exact geometry, for refinement
  /// Distances about `solid`, which make queries faster; null: they have not been measured (yet).
  std::shared_ptr<const DistanceField> field;
  bool from_cache = false;    ///< the packing was read from the cache
  double packing_time = 0.0;  ///< [s]
  bool is_final = true;       ///< false: a finer packing may take the place of this one
  /// Identifies `packing` and `tree`: links with the same id have the same ones. 0: not known.
  std::uint64_t packing_id = 0;

  /// Whether queries can answer for the link.
  bool usable() const { return error.empty(); }
};

/// All monitored links, in URDF order. Immutable once built; share it by pointer.
struct RobotModel {
  std::string name;              ///< the robot's name in the URDF
  std::string root_link;         ///< name of a link of the URDF, monitored or not
  std::vector<LinkModel> links;  ///< "by link" and a link's index mean its place here
  /// The same for models that differ in packings and trees alone. 0: not known.
  std::uint64_t geometry_id = 0;
};

/// Whether two models have the same links with the same exact geometry, in the same order: what was
/// measured with one holds for the other.
bool same_geometry(const RobotModel& a, const RobotModel& b);

/// Progress of building the model.
struct ModelProgress {
  std::string link;       ///< the link that is being packed
  std::size_t index = 0;  ///< of that link
  std::size_t count = 0;  ///< how many links
  double fraction = 0.0;  ///< of the whole robot, 0 to 1
};

/// How a robot model is built.
struct RobotModelConfig {
  PackingConfig packing;           ///< settings of every link's packing
  std::string cache_directory;     ///< empty: no cache
  std::vector<std::string> links;  ///< monitored links; empty: every link that has geometry
  /// Whether LinkModel::field is measured for every link: it takes some tenths of a second and
  /// 0.3 to 1 MB a link. Queries among points are up to twice as fast then, several times in
  /// contact, and hardly slower with coarse packings.
  bool distance_fields = false;
  int threads = 0;  ///< packing threads; 0: as many as there are cores
};

/// Each of them may be empty. They are called one at a time; `progress` and `cancelled` from
/// packing threads too, `warning` at the end. Their exceptions come out of build_robot_model.
struct RobotModelCallbacks {
  std::function<void(const ModelProgress&)> progress;  ///< called now and then
  std::function<void(const std::string&)> warning;     ///< takes one message for the user
  std::function<bool()> cancelled;                     ///< true ends building
};

/// Packs (or reads from the cache) every monitored link. Links with the same shapes are packed
/// once. A configured link that the URDF lacks, or that has no geometry, becomes a link with an
/// `error`. Deterministic for any number of threads.
/// @returns null when cancelled.
/// @throws ModelError when the packing configuration is out of range.
std::shared_ptr<const RobotModel> build_robot_model(const RobotDescription& description,
                                                    const RobotModelConfig& config,
                                                    const RobotModelCallbacks& callbacks = {});

/// An object that a link carries, such as a gripped tool: while attached, it is a part of the link.
struct AttachedObject {
  std::string name;         ///< name of the object
  std::string link;         ///< name of the link that carries it
  GeometryElement element;  ///< its frame E is the object's
};

/// Adds the objects to the robot as further elements of their links.
/// @throws ModelError when a link is not in the URDF, or its own geometry is faulty
RobotDescription with_objects(const RobotDescription& robot,
                              const std::vector<AttachedObject>& objects);

}  // namespace ist
