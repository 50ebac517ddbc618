#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "ist_proximity/geometry/span.h"
#include "ist_proximity/proximity/known_world.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// The surfaces of a robot's links, for distances to objects. Immutable, thread safe.
struct RobotSurfaces;

/// Builds a hierarchy and a hull for each link: 3 s for a million triangles.
/// @param cancelled  asked now and then; true ends the work. May be empty
/// @returns null when cancelled
std::shared_ptr<const RobotSurfaces> make_robot_surfaces(
    std::shared_ptr<const RobotModel> model, const std::function<bool()>& cancelled = {});

/// An object of a world that a link is near.
struct NearObject {
  std::size_t world = 0;   ///< its world: index in the worlds of the query
  std::size_t object = 0;  ///< its index in that world
  LinkProximity answer;    ///< of the link to this object alone: NEAR or CONTACT
};

/// Counts of a query's work, for tuning and tests.
struct WorldQueryStatistics {
  std::uint64_t objects_placed = 0;   ///< objects that are new or have moved
  std::uint64_t objects_bounded = 0;  ///< pairs of a link and an object whose boxes were compared
  std::uint64_t pairs_searched = 0;   ///< pairs of a link and an object that were measured
  std::uint64_t steps = 0;            ///< pairs of boxes and of parts that were looked at
  std::uint64_t scans = 0;            ///< links for which all objects were looked at
  std::uint64_t unfinished = 0;       ///< links that a deadline left wider than the tolerance
  double widest = 0.0;                ///< [m] see QueryStatistics
};

/// Distances from the links of a robot to the objects of known worlds.
///
/// A link and an object are measured as SelfQuery measures two links: `distance` is that of two
/// real points, and `distance - lower_bound` is at most the tolerance and the margins. In contact
/// `distance` is the signed distance of a point that is inside both, and the deepest point may be
/// deeper, but no deeper than `lower_bound`. `source` is the index of the world of the nearest
/// object, and `point` the index of the object in it.
///
/// Broad phase: each link keeps a list of the objects whose oriented boxes may come into its range
/// before link or objects have moved by 0.1 m (Verlet 1967); only these are looked at, the nearest
/// box first, and only those whose box is nearer than what was measured are measured. The search of
/// each measured pair is kept from run to run, for the last 24 objects of each link.
///
/// Each link gets the bound of its boxes and one distance first where there is a deadline; then the
/// link with the least bound goes on. Every bound holds at any time.
///
/// run() never throws and locks nothing. It allocates nothing while the worlds are the same; where
/// a world is another than at the last run, it allocates for objects that are more than ever
/// before. Working memory is about 0.8 MB for each link, and twice that where meshes have holes.
/// One object per thread.
class WorldQuery {
 public:
  /// @param robot  its exact surfaces; not null
  explicit WorldQuery(std::shared_ptr<const RobotSurfaces> robot, const QueryConfig& config = {});
  ~WorldQuery();
  WorldQuery(WorldQuery&&) noexcept;
  WorldQuery& operator=(WorldQuery&&) noexcept;

  /// @param X_FL     by link: link frame -> fixed frame, rigid; ignored where `known` is false
  /// @param known    by link: false makes the link UNKNOWN. Where it or X_FL has another size than
  ///                 the model's links, every link is UNKNOWN
  /// @param worlds   their poses are of the same instant as X_FL. A world whose X_FB has not one
  ///                 pose for each frame, or one that is not finite, makes every link UNKNOWN
  /// @param end      when to end; max(): never. The configuration's deadline is not used
  /// @param results  one per link, overwritten; without objects near, a link is CLEAR
  /// @returns false when `end` came before every link met its tolerance
  bool run(Span<const Eigen::Isometry3d> X_FL, const std::vector<bool>& known,
           Span<const PosedWorld* const> worlds, TimePoint end,
           std::vector<LinkProximity>* results);

  /// Takes effect at the next run().
  void set_config(const QueryConfig& config);
  /// [m] By link: subtracted from the lower bounds of its distances to objects, besides the
  /// objects' margins and the configuration's. >= 0; empty: 0. Takes effect at the next run().
  void set_link_margins(std::vector<double> margins);
  /// [m] Objects nearer than this are all measured, for near_objects(); 0: the nearest alone.
  void set_influence_distance(double distance);

  /// The objects that were measured for a link in the last run(): at least those nearer than the
  /// influence distance, up to 24, unless the time was over. Valid until the next run().
  Span<const NearObject> near_objects(std::size_t link) const;
  /// Whether the last run() came to an end for a link; else near_objects() may lack some.
  bool is_finished(std::size_t link) const;

  const std::shared_ptr<const RobotSurfaces>& robot() const;  ///< the one given at construction
  const WorldQueryStatistics& statistics() const;             ///< of the last run()

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace ist
