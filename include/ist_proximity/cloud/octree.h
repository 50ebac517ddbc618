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

/// The contents of a tree.
struct Octree {
  std::vector<Eigen::AlignedBox3d> occupied;  ///< [m] leaves of all sizes, in the map's frame
  std::size_t free = 0;                       ///< number of leaves known to be free
  std::size_t nodes = 0;                      ///< number of nodes, inner ones too
};

/// Reads the occupied leaves. In a binary tree each leaf says whether it is occupied; in a full
/// tree it is when its probability is at least 0.5 (log-odds >= 0), octomap's default. Unknown
/// space holds no obstacle.
///
/// The format (Hornung et al. 2013) has two bits a child, or a float and eight bits a node. It is
/// read here because liboctomap's reader does not check for the end of its input, and recurses
/// without end on data that is cut off or is no tree.
/// @param octree  overwritten; undefined when there is a fault
/// @returns an empty string, or one sentence: another type of tree, an impossible resolution, data
/// that ends too early, goes on after the tree, or is no tree. Thread safe.
std::string read_octree(const OctreeData& data, Octree* octree);

/// Reads a map file, `.bt` (binary) or `.ot` (full); its header says which.
/// @returns an empty string, or one sentence that names the fault
std::string read_octree_file(const std::string& path, Octree* octree);

}  // namespace ist
