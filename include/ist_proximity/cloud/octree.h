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
  std::vector<Eigen::AlignedBox3d>
      free_leaves;        ///< these, with OctreeLimits::keep_free; else empty
  std::size_t nodes = 0;  ///< number of nodes, inner ones too
};

/// The largest tree that is read; a larger one is refused. They bound time and memory of one map.
struct OctreeLimits {
  /// Occupied leaves. Two million take about 350 MB and a second while their index is built.
  std::size_t max_leaves = 2000000;
  /// [bytes] of the tree's data, or of a map file. It bounds the leaves known to be free, too,
  /// which take time to read but no memory: at most four for each byte.
  std::size_t max_bytes = std::size_t{256} << 20U;
  /// [m] Coordinates of occupied leaves in the map's frame. Float resolves 1 mm there.
  double max_position = 1e4;
  /// Whether free leaves are kept, too; max_leaves and max_position apply to both together then.
  bool keep_free = false;
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
/// that ends too early, goes on after the tree, or is no tree; a limit that is passed, with its
/// value. Thread safe.
std::string read_octree(const OctreeData& data, Octree* octree, const OctreeLimits& limits = {});

/// Reads a map file, `.bt` (binary) or `.ot` (full); its header says which. Only regular files are
/// read.
/// @param resolution  if not null, receives the edge of the smallest leaf [m]
/// @returns an empty string, or one sentence that names the fault
std::string read_octree_file(const std::string& path, Octree* octree,
                             const OctreeLimits& limits = {}, double* resolution = nullptr);

}  // namespace ist
