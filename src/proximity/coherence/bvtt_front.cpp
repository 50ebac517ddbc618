#include "proximity/coherence/bvtt_front.h"

#include <algorithm>

namespace ist {

BvttFront::BvttFront()
    : pairs_(kMaxPairs), bounds_(kMaxPairs, kFarAway), cover_bounds_(kMaxPairs, kFarAway) {}

void BvttFront::clear() {
  for (std::vector<float>* bounds : {&bounds_, &cover_bounds_}) {
    std::fill(bounds->begin(), bounds->begin() + static_cast<std::ptrdiff_t>(size_), kFarAway);
  }
  size_ = 0;
}

void BvttFront::begin(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
                      const DisplacementBound& displacement, float rounding) {
  if (!pose_.move(build_id, X_OL, displacement, rounding, size_)) clear();
}

void BvttFront::end(bool is_complete) {
  if (!is_complete) {
    clear();
    pose_.forget();
  }
  pose_.end(size_);
}

}  // namespace ist
