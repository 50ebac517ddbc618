#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "ist_proximity/proximity/known_world.h"

namespace ist {

/// Objects that stand near each other in one frame B.
struct ObjectGroup {
  std::size_t frame = 0;             ///< index in KnownWorld::frames()
  std::size_t first = 0, last = 0;   ///< its objects: ObjectGroups::members[first] to [last - 1]
  Eigen::Vector3d center_B;          ///< [m] of a sphere about their boxes
  double radius = 0.0;               ///< [m] of that sphere
  double extent = 0.0;               ///< [m] no point is farther from its object's origin
  double drift = 0.0, margin = 0.0;  ///< [m] the largest of their poses and of their margins
};

/// The objects of a world in groups, made with the world, so that the first query of a large world
/// need not look at each object. Immutable.
struct ObjectGroups {
  static constexpr std::size_t kSize = 32;  ///< objects in a group, at most

  explicit ObjectGroups(const KnownWorld& world);

  std::vector<std::uint32_t> members;    ///< objects, group by group
  std::vector<ObjectGroup> groups;       ///< those of a frame side by side
  std::vector<std::size_t> first_group;  ///< by frame; one more at the end
  std::vector<std::uint32_t> touchable;  ///< objects that some link may touch
  std::size_t most_nodes = 0;            ///< of an object's tree of inner spheres
  const WorldShape* open = nullptr;      ///< a shape with holes among the objects; null: none
};

}  // namespace ist
