#include "proximity/front.h"

#include <algorithm>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

// [m] After such a way a new front is better, and bounds leave no room for more that float loses.
constexpr double kLongWay = 0.1;
// A front only grows; when it is so many times what it was at first, and this more, so is a new
// one.
constexpr std::size_t kGrowth = 2, kRoom = 32;
// What has not been asked for so many times is of a cloud that is no more.
constexpr std::uint64_t kLately = 32;

}  // namespace

Front::Front() : pairs_(kMost), left_(kMost, kFarAway) {}

void Front::clear() {
  std::fill(left_.begin(), left_.begin() + static_cast<std::ptrdiff_t>(size_), kFarAway);
  size_ = first_size_ = 0;
  way_ = 0.0;
}

void Front::go_to(std::uint64_t index, const Eigen::Isometry3d& X_OL, const LinkExtent& extent) {
  way_ += extent.motion(X_OL_, X_OL);
  // Written so that NaN clears.
  const bool stays = index == index_ && size_ <= kGrowth * first_size_ + kRoom && way_ < kLongWay;
  if (!stays) clear();
  index_ = index;
  X_OL_ = X_OL;
  way_float_ = round_up(way_);
}

void Front::close(bool is_whole) {
  if (!is_whole) {
    clear();
    index_ = 0;
  }
  if (first_size_ == 0) first_size_ = size_;
}

Front* Fronts::of(std::uint64_t index) {
  ++now_;
  Kept* found = &kept_[0];
  for (Kept& kept : kept_) {
    if (kept.front.index() == index) {
      kept.asked = now_;
      return &kept.front;
    }
    if (kept.asked < found->asked) found = &kept;
  }
  if (found->asked != 0 && now_ - found->asked < kLately) return nullptr;
  found->asked = now_;
  return &found->front;
}

void Fronts::forget() {
  for (Kept& kept : kept_) {
    kept.front.close(false);
    kept.asked = 0;
  }
}

}  // namespace ist
