#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/bvh/box_node.h"
#include "internal/geometry/float_rounding.h"
#include "proximity/coherence/front_pose.h"
#include "proximity/coherence/scene_tracker.h"

namespace ist {

/// The front of a search: the parts of an index that the last searches pruned, each with its
/// bound. Together they hold every point of the index. At the next pose only those parts are looked
/// at again whose bound, less the displacement, is below what is asked for; nothing above them is
/// visited. Bounds are stored as FrontPose says.
///
/// The bounds are of the link's geometry, whatever its packing and its field are.
class SearchFront {
 public:
  /// All children of a node.
  static constexpr std::uint32_t kAllSlots = (1U << static_cast<unsigned>(kBoxWidth)) - 1U;

  /// Some children of a node, or a tile.
  struct Part {
    float bound;           ///< [m] as stored: a lower bound of their distance
    float outside;         ///< [m] as stored: every place that is nearer to one of them is outside
    std::int32_t child;    ///< the node, or the tile if negative
    std::uint32_t slots;   ///< bit k: child k of the node
    float min[3], max[3];  ///< [m] box about all of `child`, in the index's frame
  };

  /// The least bounds of some parts; +inf: there are none.
  struct LeastBounds {
    float bound = std::numeric_limits<float>::infinity();    ///< [m]
    float outside = std::numeric_limits<float>::infinity();  ///< [m]
  };

  SearchFront() : parts_(kMaxParts) {}

  /// Before begin(): the radii of the spheres that the bounds will be of; of a front of obstacles
  /// themselves it is not called. Bounds of spheres with other radii are discarded.
  /// @param points  of points
  /// @param boxes   [m] of every box
  void set_extents(const PointExtent& points, double boxes) {
    if (!same_extent(points, points_) || boxes != boxes_) end(false);
    points_ = points;
    boxes_ = boxes;
  }
  /// Begins a search at a new pose.
  /// @param build_id      of the index
  /// @param X_OL          link -> the index's frame
  /// @param rounding      [m] largest error of a lower bound of this search
  void begin(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
             const DisplacementBound& displacement, float rounding) {
    if (!pose_.move(build_id, X_OL, displacement, rounding, size_)) size_ = 0;
    is_full_ = false;
  }
  /// @param is_complete  false: some point is in no part; the front is discarded
  void end(bool is_complete) {
    if (!is_complete || is_full_) {
      size_ = 0;
      pose_.forget();
    }
    pose_.end(size_);
  }
  /// The index that the front belongs to; 0: there is no front.
  std::uint64_t build_id() const { return pose_.build_id(); }

  bool empty() const { return size_ == 0; }
  /// Adds a part with its bounds at the pose of this search.
  /// @returns its number
  std::uint32_t add(const Part& part) {
    is_full_ = is_full_ || size_ == kMaxParts;
    if (is_full_) return kMaxParts;
    parts_[size_] = part;
    parts_[size_].bound = stored(part.bound);
    parts_[size_].outside = stored(part.outside);
    return static_cast<std::uint32_t>(size_++);
  }
  /// Something with these bounds belongs to a part, too.
  /// @param part  by add(), in this search
  void lower(std::uint32_t part, float bound, float outside) {
    if (part == kMaxParts) return;
    parts_[part].bound = std::min(parts_[part].bound, stored(bound));
    parts_[part].outside = std::min(parts_[part].outside, stored(outside));
  }
  /// Removes the parts that are to be looked at again: those whose bound is below a limit and, near
  /// holes, those that may be inside.
  /// @param limit      [m] at the pose of this search
  /// @param is_closed  whether the link's surface is: a point comes to be inside through it only
  /// @param reopen     is called with each of them, its bounds being those at that pose
  /// @returns the bounds of the parts that stay, at that pose
  template <class Reopen>
  LeastBounds remove_below(float limit, bool is_closed, const Reopen& reopen) {
    // Nearly all parts stay: they are compared as stored, and only their least bound is moved.
    LeastBounds least;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < size_; ++i) {
      // Written so that a bound of NaN is looked at again.
      if (difference(parts_[i].bound) >= static_cast<double>(limit) &&
          (is_closed || difference(parts_[i].outside) > 0.0)) {
        least.bound = std::min(least.bound, parts_[i].bound);
        least.outside = std::min(least.outside, parts_[i].outside);
        if (kept != i) parts_[kept] = parts_[i];
        ++kept;
        continue;
      }
      Part part = parts_[i];
      part.bound = round_down(difference(part.bound));
      part.outside = round_down(difference(part.outside));
      reopen(part);
    }
    size_ = kept;
    return {round_down(difference(least.bound)), round_down(difference(least.outside))};
  }

  std::size_t memory() const { return parts_.capacity() * sizeof(Part); }  ///< [bytes]

 private:
  static constexpr std::uint32_t kMaxParts = 512;  ///< a search that leaves more keeps no front

  // Sums are in double: where the range has no end, roundings are so large that a float beside them
  // would lose a bound's digits.
  float stored(float bound) const {
    return round_down(static_cast<double>(bound) + pose_.offset());
  }
  double difference(float stored) const { return static_cast<double>(stored) - pose_.offset(); }

  std::vector<Part> parts_;
  std::size_t size_ = 0;
  bool is_full_ = false;
  FrontPose pose_;
  PointExtent points_;
  double boxes_ = 0.0;  // [m]
};

using SearchFronts = KeptFronts<SearchFront, 4>;

}  // namespace ist
