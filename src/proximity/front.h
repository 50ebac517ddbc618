#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "proximity/carried_bound.h"

namespace ist {

/// Where the last descents of a link's tree against an index have ended: every pair that they
/// expanded, with the least bound of what they left of it. At the next pose only those pairs are
/// opened again of which what was left may matter now, the link having gone a way since; the others
/// stay as they are, and what is above is not looked at.
///
/// Bounds are kept as they were at the front's first pose, at least: with the way that was gone
/// until then added. So one number tells how far all of them have shrunk. Ways add up, and so are
/// never shorter than what any point of the link has gone.
class Front {
 public:
  struct Pair {
    std::int32_t sphere, box;  ///< slots: kSphereWidth * node + child, kPointWidth * node + child
    std::uint32_t expanded;    ///< bit k: its child k is in the front, too
  };
  static constexpr std::int32_t kRoot = -1;  ///< as a slot: all of it
  static constexpr std::size_t kMost = 512;  ///< pairs; what expands more leaves no front
  static constexpr std::int32_t kFull = -1;  ///< as a pair's index: there is no room for it

  Front();

  /// To be called before a descent. Without a front to go on from, it is empty then.
  /// @param index  build_id of the index
  /// @param X_OL   of the link, in its frame
  void go_to(std::uint64_t index, const Eigen::Isometry3d& X_OL, const LinkExtent& extent);
  /// To be called after it. False: it was cut short, or there was no room.
  void close(bool is_whole);
  /// Of which index; 0: there is no front.
  std::uint64_t index() const { return index_; }

  bool empty() const { return size_ == 0; }
  std::size_t size() const { return size_; }
  float way() const { return way_float_; }  ///< [m] gone, rounded up

  const Pair& pair(std::int32_t i) const { return pairs_[static_cast<std::size_t>(i)]; }
  /// [m] By pair; far away for what is left over of kMost.
  const float* left() const { return left_.data(); }

  /// @returns its index, or kFull
  std::int32_t add(std::int32_t sphere, std::int32_t box) {
    if (size_ == kMost) return kFull;
    pairs_[size_] = {sphere, box, 0};
    return static_cast<std::int32_t>(size_++);
  }
  void mark_expanded(std::int32_t i, int child) {
    pairs_[static_cast<std::size_t>(i)].expanded |= 1U << static_cast<std::uint32_t>(child);
  }
  /// Something with this bound is left of the pair.
  void leave(std::int32_t i, float bound) {
    float& left = left_[static_cast<std::size_t>(i)];
    left = bound < left ? bound : left;
  }
  /// Nothing is left of the pair: it is expanded once more.
  void open(std::int32_t i) { left_[static_cast<std::size_t>(i)] = kFarAway; }

 private:
  void clear();

  std::vector<Pair> pairs_;
  std::vector<float> left_;
  std::size_t size_ = 0, first_size_ = 0;
  std::uint64_t index_ = 0;
  Eigen::Isometry3d X_OL_ = Eigen::Isometry3d::Identity();
  double way_ = 0.0;
  float way_float_ = 0.0F;
};

/// The fronts of one link: one for each of so many indices.
class Fronts {
 public:
  /// That of an index; if there is none, the one that has not been asked for longest. Null: all
  /// have been lately, and where more indices are at work than these, it is best that some keep
  /// theirs.
  Front* of(std::uint64_t index);
  void forget();

 private:
  struct Kept {
    Front front;
    std::uint64_t asked = 0;  ///< when
  };
  std::array<Kept, 4> kept_;
  std::uint64_t now_ = 0;
};

}  // namespace ist
