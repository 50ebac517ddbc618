#include "proximity/coherence/bvtt_front.h"

#include <algorithm>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

// [m] After such a displacement a new front is better, and float still resolves the stored bounds.
constexpr double kMaxDisplacement = 0.1;
// A front only grows. It is discarded when it has more pairs than this factor times its first size,
// and this many more.
constexpr std::size_t kMaxGrowth = 2, kMinGrowth = 32;
// An index that has not been asked for in so many queries is no longer in use.
constexpr std::uint64_t kInUse = 32;

}  // namespace

BvttFront::BvttFront()
    : pairs_(kMaxPairs), bounds_(kMaxPairs, kFarAway), cover_bounds_(kMaxPairs, kFarAway) {}

void BvttFront::clear() {
  for (std::vector<float>* bounds : {&bounds_, &cover_bounds_}) {
    std::fill(bounds->begin(), bounds->begin() + static_cast<std::ptrdiff_t>(size_), kFarAway);
  }
  size_ = first_size_ = 0;
  displacement_ = 0.0;
}

void BvttFront::begin(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
                      const DisplacementBound& displacement, float rounding) {
  displacement_ += displacement.between(X_OL_, X_OL);
  // Written so that a displacement that is NaN discards the front.
  const bool is_valid = build_id == build_id_ && size_ <= kMaxGrowth * first_size_ + kMinGrowth &&
                        displacement_ < kMaxDisplacement;
  if (!is_valid) clear();
  build_id_ = build_id;
  X_OL_ = X_OL;
  // A stored bound is lowered by the rounding of the traversal that stores it, and raised by that
  // of the traversal that reads it, which takes its own rounding off every bound in the end.
  offset_ = round_up(displacement_) - rounding;
}

void BvttFront::end(bool is_complete) {
  if (!is_complete) {
    clear();
    build_id_ = 0;
  }
  if (first_size_ == 0) first_size_ = size_;
}

BvttFront* BvttFronts::find(std::uint64_t build_id) {
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

void BvttFronts::forget() {
  for (Slot& slot : slots_) {
    slot.front.end(false);
    slot.last_used = 0;
  }
}

}  // namespace ist
