#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace ist {

/// Which sphere covers a convex patch best, while spheres are still being added.
///
/// The cost of a sphere for a patch is the largest of |v - c| - weight over the patch's corners v:
/// the distance to a sphere is convex, so no point of the patch is farther from the sphere than
/// that. A tree over the spheres, to which spheres are added one by one; it is built anew when it
/// has grown.
class SphereSearch {
 public:
  struct Match {
    std::uint32_t sphere = 0;
    double cost = 0.0;  ///< [m] negative: the patch is inside the sphere by that much
  };

  /// Adds a sphere with weight [m] (its inner or outer radius).
  void add(const Eigen::Vector3d& center, double weight);

  /// The sphere of least cost among those added after the first `seen`, and `hint` (any sphere's
  /// index); ties go to the lowest index. Needs at least one sphere.
  /// @param enough  [m] the first sphere found whose cost is no more than this will do
  Match best(const Eigen::Vector3d* corners, int corner_count, std::uint32_t hint,
             std::size_t seen = 0, double enough = -std::numeric_limits<double>::infinity()) const;

  std::size_t size() const { return spheres_.size(); }
  const Eigen::Vector3d& center(std::uint32_t sphere) const { return spheres_[sphere].center; }
  double weight(std::uint32_t sphere) const { return spheres_[sphere].weight; }

 private:
  static constexpr std::uint32_t kLeafSize = 8;

  struct Item {
    Eigen::Vector3d center;
    double weight;
  };
  struct Node {
    Eigen::AlignedBox3d box;  ///< of the centres
    double min_weight, max_weight;
    std::uint32_t newest;  ///< largest index of a sphere below
    std::uint32_t count;   ///< leaf: spheres; inner: 0
    /// Leaf: its spheres; inner: its two children, as indices into nodes_.
    std::array<std::uint32_t, kLeafSize> below;
  };

  void rebuild();
  std::uint32_t build(std::uint32_t* first, std::uint32_t* last);
  Node around(const std::uint32_t* first, const std::uint32_t* last) const;
  std::uint32_t* halve(std::uint32_t* first, std::uint32_t* last, const Node& node) const;
  void insert(std::uint32_t sphere);
  void extend(Node* node, std::uint32_t sphere) const;
  static double apart_sq(const Node& node, const Item& sphere);

  std::vector<Item> spheres_;
  std::vector<Node> nodes_;  // 0 is the root
  std::size_t built_ = 0;    // spheres when the tree was last built
};

}  // namespace ist
