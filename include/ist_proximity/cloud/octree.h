#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace ist {

/// An OctoMap tree as its bytes (the members of octomap_msgs/Octomap).
struct OctreeData {
  std::string id;                      ///< type of the tree; "OcTree" is what can be read
  bool is_binary = false;              ///< free and occupied only, else log-odds
  double resolution = 0.0;             ///< [m] edge of the smallest leaf
  const std::uint8_t* data = nullptr;  ///< not owned; depth first, as octomap::OcTree writes it
  std::size_t size = 0;                ///< [bytes]; 0: an empty map
};

/// What a tree holds.
struct Octree {
  std::vector<Eigen::AlignedBox3d> occupied;  ///< [m] leaves of all sizes, in the map's frame
  std::size_t free = 0;                       ///< number of leaves known to be free
  std::size_t nodes = 0;                      ///< of the tree, inner ones too
};

/// Reads the occupied leaves: those of a binary tree that it says are, those of a full tree with a
/// probability of at least 0.5 (log-odds >= 0), as octomap does by itself. Unknown space holds no
/// obstacle.
///
/// The format (Hornung et al. 2013) is two bits a child, or a float and eight bits a node, so it is
/// read here: liboctomap's own reader does not look for the end of its input, and recurses without
/// end on what is cut off or something else.
/// @param octree  overwritten; without meaning when there is a fault
/// @returns an empty string, or one sentence: another type of tree, a resolution that cannot be,
/// data that ends too early, goes on too long, or is no tree. Thread safe.
std::string read_octree(const OctreeData& data, Octree* octree);

/// Reads a map file, `.bt` (binary) or `.ot` (full); its header tells which.
/// @returns an empty string, or one sentence with what is wrong
std::string read_octree_file(const std::string& path, Octree* octree);

}  // namespace ist
