#include "proximity/coherence/front_pose.h"

namespace ist {
namespace {

// [m] After such a displacement a new front is better, and float still resolves the stored bounds.
constexpr double kMaxDisplacement = 0.1;
// A front only grows. It is discarded when it is larger than this factor times its first size, and
// this much more.
constexpr std::size_t kMaxGrowth = 2, kMinGrowth = 32;

}  // namespace

bool FrontPose::move(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
                     const DisplacementBound& displacement, float rounding, std::size_t size) {
  displacement_ += displacement.between(X_OL_, X_OL);
  // Written so that a displacement that is NaN discards the front.
  const bool is_valid = build_id == build_id_ && size <= kMaxGrowth * first_size_ + kMinGrowth &&
                        displacement_ < kMaxDisplacement;
  if (!is_valid) {
    displacement_ = 0.0;
    first_size_ = 0;
  }
  build_id_ = build_id;
  X_OL_ = X_OL;
  // A stored bound is lowered by the rounding of the search that stores it, and raised by that of
  // the search that reads it, which takes its own rounding off every bound in the end.
  offset_ = displacement_ - static_cast<double>(rounding);
  return is_valid;
}

}  // namespace ist
