#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "ist_proximity/packing/packing.h"

namespace ist {

/// Which ball covers a convex patch best, while balls are still being added.
///
/// The cost of a ball for a patch is the largest of |v - c| - weight over the patch's corners v:
/// the distance to a ball is convex, so no point of the patch is farther from the ball than that.
/// A tree over the balls of some time ago, and a plain list of the newer ones.
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
  Match best(const Eigen::Vector3d* corners, int corner_count, std::uint32_t hint,
             std::size_t seen = 0) const;

  std::size_t size() const { return balls_.size(); }
  const Eigen::Vector3d& center(std::uint32_t ball) const { return balls_[ball].center; }
  double weight(std::uint32_t ball) const { return balls_[ball].weight; }

 private:
  struct Item {
    Eigen::Vector3d center;
    double weight;
  };
  struct Node {
    Eigen::AlignedBox3d box;  ///< of the centres
    double max_weight;
    std::uint32_t first, count;  ///< leaf: range in order_; inner: first = right child, count = 0
    std::uint32_t newest;        ///< largest index of a ball below
  };

  void rebuild();
  std::uint32_t build(std::uint32_t first, std::uint32_t last);

  std::vector<Item> balls_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
  std::size_t in_tree_ = 0;
};

}  // namespace ist
