// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/index/image_kernel.cpp"
#include "cloud/index/image_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <limits>

#if HWY_TARGET == HWY_SCALAR
#include "cloud/index/patch_survey_scalar-inl.h"
#else
#include "cloud/index/patch_survey-inl.h"
#endif

#if HWY_ONCE
namespace ist {
namespace {

// What float makes of a squared range is off by less than this share of it.
constexpr double kSquareError = 1e-6;
// Below, squares are no longer that exact.
constexpr double kSmallestSquare = 1e-30;  // [m^2]

}  // namespace

PatchPose::PatchPose(const CropPose& pose) {
  const Eigen::Matrix3d& rotation = pose.X_OS.linear();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      R[3 * row + column] = static_cast<float>(rotation(row, column));
    }
    t[row] = static_cast<float>(pose.X_OS.translation()[row]);
  }
  translation = static_cast<float>(pose.X_OS.translation().norm() * (1.0 + kSquareError));
  const double min_sq = pose.min_range_sq, max_sq = pose.max_range_sq;
  least = static_cast<float>(min_sq > 0.0 ? std::max((1.0 + kSquareError) * min_sq, kSmallestSquare)
                                          : 0.0);
  none_below = static_cast<float>(min_sq > kSmallestSquare ? (1.0 - kSquareError) * min_sq : 0.0);
  most = static_cast<float>((1.0 - kSquareError) * max_sq);
  none_above = static_cast<float>(std::max((1.0 + kSquareError) * max_sq, kSmallestSquare));
}

PatchPose PatchPose::without_limits() const {
  PatchPose pose = *this;
  pose.least = pose.none_below = 0.0F;
  pose.most = pose.none_above = std::numeric_limits<float>::max();
  return pose;
}

HWY_EXPORT(SurveyPatch);

PatchState survey_patch(const PatchPose& pose, const PatchPixels& pixels, Patch* patch) {
  return HWY_DYNAMIC_DISPATCH(SurveyPatch)(pose, pixels, patch);
}

}  // namespace ist
#endif
