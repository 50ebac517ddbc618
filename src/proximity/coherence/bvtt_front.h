#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/bvh/box_node.h"
#include "proximity/coherence/displacement.h"
#include "proximity/coherence/front_pose.h"

namespace ist {

/// The front of a bounding volume test tree (BVTT; Ehmann and Lin 2001): the pairs of sphere node
/// and box node that the last dual-tree traversals of a link against one index expanded, each with
/// the least lower bound that was pruned below it. At the next pose only those pairs are expanded
/// again whose pruned bound, less the displacement, is below what is asked for; nothing above them
/// is visited.
///
/// Stored bounds are relative to the front's first pose, see FrontPose.
///
/// A pair of leaves is not expanded, but its points may be known to be farther from the
/// whole link than their cover distances say: exact distances are stored as its bound. If the link
/// is a mesh with holes, such points must also stay outside, and the pair keeps their least cover
/// distance beside it (see stays_outside()).
class BvttFront {
 public:
  struct Pair {
    /// Slots: kSphereWidth * node + child and kBoxWidth * node + child, or kRoot.
    std::int32_t sphere, box;
    std::uint32_t expanded;  ///< bit k: child k of the pair is a pair of the front, too
  };
  static constexpr std::int32_t kRoot = -1;
  static constexpr std::size_t kMaxPairs = 2048;  ///< a traversal that expands more keeps no front
  static constexpr std::int32_t kFull = -1;       ///< instead of a pair's index: there is no place

  BvttFront();

  /// Begins a traversal at a new pose. The front is empty afterwards where it is of another index,
  /// where the link has moved far, or where it has grown too much.
  /// @param build_id  of the index
  /// @param X_OL      link -> the index's frame
  /// @param rounding  [m] largest error of a lower bound of this traversal
  void begin(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
             const DisplacementBound& displacement, float rounding);
  /// Ends a traversal.
  /// @param is_complete  false: it was stopped, or a pair found no place; the front is discarded
  void end(bool is_complete);
  /// The index that the front belongs to; 0: there is no front.
  std::uint64_t build_id() const { return pose_.build_id(); }

  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  const Pair& pair(std::int32_t i) const { return pairs_[static_cast<std::size_t>(i)]; }

  /// [m] By pair, as stored: kFarAway where nothing was pruned, and beyond size().
  const float* stored_bounds() const { return bounds_.data(); }
  /// [m] The least cover distance of points whose stored bound says more than that; kFarAway where
  /// there are none.
  const float* stored_cover_bounds() const { return cover_bounds_.data(); }
  /// [m] What is added to a bound of this traversal when it is stored.
  float offset() const { return pose_.offset(); }

  /// Adds a pair. @returns its index, or kFull
  std::int32_t add(std::int32_t sphere, std::int32_t box) {
    if (size_ == kMaxPairs) return kFull;
    pairs_[size_] = {sphere, box, 0};
    return static_cast<std::int32_t>(size_++);
  }
  void mark_expanded(std::int32_t i, int child) {
    pairs_[static_cast<std::size_t>(i)].expanded |= 1U << static_cast<std::uint32_t>(child);
  }
  /// Something with this lower bound [m] of this traversal was pruned below the pair.
  void prune(std::int32_t i, float bound) {
    float& stored = bounds_[static_cast<std::size_t>(i)];
    stored = std::min(stored, bound + offset());
  }
  /// The points that were pruned below the pair are outside a mesh with holes, and their cover
  /// distance is at least this [m].
  void keep_cover_bound(std::int32_t i, float bound) {
    float& stored = cover_bounds_[static_cast<std::size_t>(i)];
    stored = std::min(stored, bound + offset());
  }
  /// The pair is expanded once more: nothing is pruned below it for now.
  void reopen(std::int32_t i) {
    bounds_[static_cast<std::size_t>(i)] = cover_bounds_[static_cast<std::size_t>(i)] = kFarAway;
  }

  std::size_t memory() const {  ///< [bytes]
    return pairs_.capacity() * sizeof(Pair) +
           (bounds_.capacity() + cover_bounds_.capacity()) * sizeof(float);
  }

 private:
  void clear();

  std::vector<Pair> pairs_;
  std::vector<float> bounds_, cover_bounds_;
  std::size_t size_ = 0;
  FrontPose pose_;
};

using BvttFronts = KeptFronts<BvttFront, 4>;

}  // namespace ist
