#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>

#include "proximity/coherence/displacement.h"

namespace ist {

/// How far a link has moved since the first pose of a front, and how long the front is of use.
///
/// The bounds of a front are stored relative to its first pose: offset() is added when one is
/// stored and subtracted when it is read. So one number updates all of them. It holds a sum of
/// displacements between successive poses, which is never below the displacement of any point.
class FrontPose {
 public:
  /// Begins a search at a new pose.
  /// @param build_id  of the index
  /// @param X_OL      link -> the index's frame
  /// @param rounding  [m] largest error of a lower bound of this search
  /// @param size      of the front
  /// @returns false: the front is to be emptied, as it is of another index, the link has moved far,
  ///          or it has grown too much; it begins anew here
  bool move(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
            const DisplacementBound& displacement, float rounding, std::size_t size);
  /// Ends the first search of a front, and no other one.
  /// @param size  of the front
  void end(std::size_t size) {
    if (first_size_ == 0) first_size_ = size;
  }
  void forget() { *this = FrontPose(); }

  std::uint64_t build_id() const { return build_id_; }  ///< of the index; 0: there is no front
  /// [m] What is added to a bound of this search when it is stored.
  double offset() const { return offset_; }

 private:
  std::uint64_t build_id_ = 0;
  std::size_t first_size_ = 0;
  Eigen::Isometry3d X_OL_ = Eigen::Isometry3d::Identity();
  double displacement_ = 0.0;  ///< [m] since the first pose
  double offset_ = 0.0;
};

/// The fronts of one link, one for each of the last few indices.
/// @tparam kCount  so many
template <class Front, std::size_t kCount>
class KeptFronts {
 public:
  /// The front of an index, or the one that has not been used for longest. Null where all were used
  /// lately: with more indices in use than fronts, it is best that some keep theirs.
  Front* find(std::uint64_t build_id) {
    ++now_;
    Slot* found = &slots_[0];
    for (Slot& slot : slots_) {
      if (slot.front.build_id() == build_id) {
        slot.last_used = now_;
        return &slot.front;
      }
      if (slot.last_used < found->last_used) found = &slot;
    }
    if (found->last_used != 0 && now_ - found->last_used < kInUse) return nullptr;
    found->last_used = now_;
    return &found->front;
  }
  void forget() {
    for (Slot& slot : slots_) {
      slot.front.end(false);
      slot.last_used = 0;
    }
  }
  std::size_t memory() const {  ///< [bytes]
    std::size_t bytes = 0;
    for (const Slot& slot : slots_) bytes += slot.front.memory();
    return bytes;
  }

 private:
  // An index that has not been asked for in so many queries is no longer in use.
  static constexpr std::uint64_t kInUse = 32;
  struct Slot {
    Front front;
    std::uint64_t last_used = 0;
  };
  std::array<Slot, kCount> slots_;
  std::uint64_t now_ = 0;
};

}  // namespace ist
