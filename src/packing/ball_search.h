#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace ist {

/// Which ball covers a convex patch best, while balls are still being added.
///
/// The cost of a ball for a patch is the largest of |v - c| - weight over the patch's corners v:
/// the distance to a ball is convex, so no point of the patch is farther from the ball than that.
/// A tree over the balls, to which balls are added one by one; it is built anew when it has grown.
class BallSearch {
 public:
  struct Match {
    std::uint32_t ball = 0;
    double cost = 0.0;  ///< [m] negative: the patch is inside the ball by that much
  };

  /// Adds a ball with weight [m] (its inner or outer radius).
  void add(const Eigen::Vector3d& center, double weight);

  /// The ball of least cost among those added after the first `seen`, and `hint` (any ball's
  /// index); ties go to the lowest index. Needs at least one ball.
  /// @param enough  [m] the first ball found whose cost is no more than this will do
  Match best(const Eigen::Vector3d* corners, int corner_count, std::uint32_t hint,
             std::size_t seen = 0, double enough = -std::numeric_limits<double>::infinity()) const;

  std::size_t size() const { return balls_.size(); }
  const Eigen::Vector3d& center(std::uint32_t ball) const { return balls_[ball].center; }
  double weight(std::uint32_t ball) const { return balls_[ball].weight; }

 private:
  static constexpr std::uint32_t kLeafSize = 8;

  struct Item {
    Eigen::Vector3d center;
    double weight;
  };
  struct Node {
    Eigen::AlignedBox3d box;  ///< of the centres
    double min_weight, max_weight;
    std::uint32_t newest;  ///< largest index of a ball below
    std::uint32_t count;   ///< leaf: balls; inner: 0
    /// Leaf: its balls; inner: its two children, as indices into nodes_.
    std::array<std::uint32_t, kLeafSize> below;
  };

  void rebuild();
  std::uint32_t build(std::uint32_t* first, std::uint32_t* last);
  Node around(const std::uint32_t* first, const std::uint32_t* last) const;
  std::uint32_t* halve(std::uint32_t* first, std::uint32_t* last, const Node& node) const;
  void insert(std::uint32_t ball);
  void extend(Node* node, std::uint32_t ball) const;
  static double apart_sq(const Node& node, const Item& ball);

  std::vector<Item> balls_;
  std::vector<Node> nodes_;  // 0 is the root
  std::size_t built_ = 0;    // balls when the tree was last built
};

}  // namespace ist
