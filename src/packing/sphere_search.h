#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace ist {

/// Nearest-sphere search for points and convex patches, while spheres are still being added.
///
/// The cost of a sphere for a patch is the largest of |v - center| - weight over the patch's
/// corners v. The distance to a sphere is convex, so no point of the patch is farther from the
/// sphere than the cost. For a single point the least cost is its distance to the spheres (the
/// additively weighted Voronoi, or Apollonius, diagram).
///
/// A binary BVH over centres and weights, searched by branch and bound. Spheres are inserted one by
/// one; the BVH is rebuilt when it has grown by half. Equal calls give equal answers. Const
/// functions are thread safe; add() is not.
class SphereSearch {
 public:
  struct Match {
    std::uint32_t sphere = 0;  ///< index, in the order of insertion
    double cost = 0.0;         ///< [m] negative: the patch is inside the sphere by that much
  };

  /// @param weight  [m] the inner or the cover radius
  void add(const Eigen::Vector3d& center, double weight);

  /// Returns a sphere that costs no more than `hint` and all spheres from index `first` on; of
  /// equal ones the lowest index. At least one sphere must have been added.
  /// @param corners  [m] of a convex patch; a single one is a point
  /// @param hint     any sphere's index; a good one prunes more
  /// @param enough   [m] the search ends at the first sphere whose cost is at most this
  Match best(const Eigen::Vector3d* corners, int corner_count, std::uint32_t hint,
             std::size_t first = 0, double enough = -std::numeric_limits<double>::infinity()) const;

  std::size_t size() const { return spheres_.size(); }
  const Eigen::Vector3d& center(std::uint32_t sphere) const { return spheres_[sphere].center; }
  double weight(std::uint32_t sphere) const { return spheres_[sphere].weight; }

 private:
  static constexpr std::uint32_t kLeafSize = 8;

  struct WeightedCenter {
    Eigen::Vector3d center;
    double weight;
  };
  struct Node {
    Eigen::AlignedBox3d box;  ///< of the centres
    double min_weight, max_weight;
    std::uint32_t newest;  ///< largest index of a sphere in the subtree
    std::uint32_t count;   ///< leaf: its spheres; inner node: 0
    /// Leaf: indices of its spheres. Inner node: the first two are its children in nodes_.
    std::array<std::uint32_t, kLeafSize> children;
  };
  class PatchCorners;

  void rebuild();
  std::uint32_t build(std::uint32_t* first, std::uint32_t* last);
  Node make_node(const std::uint32_t* first, const std::uint32_t* last) const;
  std::uint32_t* split_at_median(std::uint32_t* first, std::uint32_t* last, const Node& node) const;
  void insert(std::uint32_t sphere);
  void split_leaf(std::uint32_t leaf, std::uint32_t added);
  void extend(Node* node, std::uint32_t sphere) const;
  void search_leaf(const Node& leaf, const PatchCorners& patch, Match* match) const;
  static double distance_sq(const Node& node, const WeightedCenter& sphere);

  std::vector<WeightedCenter> spheres_;
  std::vector<Node> nodes_;  // the root is nodes_[0]
  std::size_t built_ = 0;    // spheres at the last rebuild
};

}  // namespace ist
