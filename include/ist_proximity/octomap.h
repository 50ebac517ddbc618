#pragma once

// Maps of OctoMap as obstacles, and a memory as a map of OctoMap. Header only: a program that
// includes it links octomap; this library needs none.
//
//     const auto obstacles = ist::to_obstacles(octree);  // an OcTree, a ColorOcTree
//     const auto answers = robot.distances(q, obstacles);

#include <octomap/OcTree.h>
#include <octomap/OccupancyOcTreeBase.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "ist_proximity/cloud/memory_map.h"
#include "ist_proximity/cloud/octree.h"
#include "ist_proximity/facade/obstacles.h"

namespace ist {

/// The part of a tree that becomes obstacles.
struct OctomapSelection {
  /// 1 to 16: leaves below this depth are joined, so that boxes are larger and fewer; a joined one
  /// is occupied where a leaf in it is. 0: all leaves as they are.
  unsigned max_depth = 0;
  /// [m] in the map's frame, not NaN: leaves that do not reach into it are left out. Empty: none
  /// is.
  Eigen::AlignedBox3d region;
  OctreeLimits limits;  ///< more leaves, or farther ones, are refused (max_leaves, max_position)
};

/// The occupied leaves of a tree as solid boxes [m] in the map's frame M, as read_octree() gives
/// them of the tree's message or file, to the bit. Unknown space holds no obstacle.
/// @tparam Node  OcTreeNode, ColorOcTreeNode, or another that has an occupancy
/// @throws std::invalid_argument when a limit is passed, max_depth is over 16, or the region or the
///         occupancy of a leaf is NaN
template <class Node>
std::vector<Eigen::AlignedBox3d> occupied_boxes(const octomap::OccupancyOcTreeBase<Node>& tree,
                                                const OctomapSelection& selection = {}) {
  constexpr int kHalf = 1 << 15;  // smallest leaves from the middle to a side
  if (selection.max_depth > tree.getTreeDepth()) {
    throw std::invalid_argument("max_depth is " + std::to_string(selection.max_depth) +
                                "; a tree has " + std::to_string(tree.getTreeDepth()) + " levels.");
  }
  if (selection.region.min().hasNaN() || selection.region.max().hasNaN()) {
    throw std::invalid_argument("the region is not a number.");
  }
  const unsigned depth = selection.max_depth > 0 ? selection.max_depth : tree.getTreeDepth();
  std::vector<Eigen::AlignedBox3d> boxes;
  const auto end = tree.end_leafs();
  // All leaves are asked: what an inner node says is old where leaves were updated lazily.
  for (auto leaf = tree.begin_leafs(); leaf != end; ++leaf) {
    if (std::isnan(leaf->getLogOdds())) {
      throw std::invalid_argument("the tree has a leaf whose log-odds value is not a number.");
    }
    if (!tree.isNodeOccupied(*leaf)) continue;
    // Corners are whole numbers times the resolution, so that neighbours meet exactly.
    const int size = 1 << (tree.getTreeDepth() - std::min(leaf.getDepth(), depth));
    const octomap::OcTreeKey key = leaf.getIndexKey();
    const Eigen::Vector3i low =
        (Eigen::Vector3i(key[0], key[1], key[2]) / size * size).array() - kHalf;
    const Eigen::Vector3i high = low.array() + size;
    const Eigen::AlignedBox3d box(tree.getResolution() * low.cast<double>(),
                                  tree.getResolution() * high.cast<double>());
    if (!selection.region.isEmpty() && !selection.region.intersects(box)) continue;
    // Leaves that are joined come one after another.
    if (!boxes.empty() && boxes.back().min() == box.min() && boxes.back().max() == box.max()) {
      continue;
    }
    if (boxes.size() >= selection.limits.max_leaves) {
      throw std::invalid_argument("the tree has more occupied leaves than allowed, which are " +
                                  std::to_string(selection.limits.max_leaves) +
                                  " (max_leaves): choose a region, or join leaves by max_depth.");
    }
    if (!(box.min().cwiseAbs().cwiseMax(box.max().cwiseAbs()).maxCoeff() <=
          selection.limits.max_position)) {
      std::ostringstream text;
      text << "the tree has an occupied leaf from (" << box.min().transpose() << ") to ("
           << box.max().transpose() << ") m, farther out than " << selection.limits.max_position
           << " m (max_position).";
      throw std::invalid_argument(text.str());
    }
    boxes.push_back(box);
  }
  return boxes;
}

/// A tree's occupied leaves as obstacles. An empty tree is an empty list: there are no obstacles.
/// @param X_FM  map -> fixed frame, rigid
/// @throws std::invalid_argument as occupied_boxes() and Obstacles::from_boxes()
template <class Node>
Obstacles to_obstacles(const octomap::OccupancyOcTreeBase<Node>& tree,
                       const Eigen::Isometry3d& X_FM = Eigen::Isometry3d::Identity(),
                       const OctomapSelection& selection = {}) {
  return Obstacles::from_boxes(occupied_boxes(tree, selection), X_FM);
}

/// Makes a tree of what a memory knows, free and occupied.
/// @throws std::runtime_error when liboctomap does not take the tree
inline std::unique_ptr<octomap::OcTree> to_octree(const MemoryMap& memory) {
  auto tree = std::make_unique<octomap::OcTree>(memory.config().resolution);
  const std::vector<std::uint8_t> bytes = memory.octree_bytes();
  if (bytes.empty()) return tree;
  std::stringstream stream(std::string(bytes.begin(), bytes.end()));
  tree->readBinaryData(stream);
  if (!stream) throw std::runtime_error("liboctomap does not read the memory's tree");
  return tree;
}

}  // namespace ist
