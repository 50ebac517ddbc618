#include <algorithm>
#include <array>
#include <cstddef>

#include "cloud/filters/view_filter.h"
#include "cloud/format/point_reader.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// The median of the angles [rad] between neighbours, of some samples; inf: too few were measured.
class NeighbourAngles {
 public:
  bool is_full() const { return count_ == values_.size(); }
  void add(const Eigen::Vector3d& p, const Eigen::Vector3d& q) {
    if (is_full() || !p.allFinite() || !q.allFinite()) return;
    const double norms = p.norm() * q.norm();
    if (norms > 0.0) values_[count_++] = p.cross(q).norm() / norms;
  }
  double median() {
    if (count_ < kFewest) return kInfinity;
    const auto middle = values_.begin() + static_cast<std::ptrdiff_t>(count_ / 2);
    std::nth_element(values_.begin(), middle,
                     values_.begin() + static_cast<std::ptrdiff_t>(count_));
    return *middle;
  }

 private:
  static constexpr std::size_t kFewest = 8;
  std::array<double, 256> values_;
  std::size_t count_ = 0;
};

}  // namespace

bool is_view(const RawCloud& cloud) {
  if (cloud.width < kTileSide || cloud.height < kTileSide) return false;
  if (cloud.depth != DepthType::kNone) return true;
  constexpr std::size_t kSamples = 2048;
  // An odd stride: the samples are to be spread over the columns.
  const std::size_t stride = cloud.size() / kSamples | 1U;
  NeighbourAngles across, down;
  for (std::size_t i = 0; i < cloud.size() && !(across.is_full() && down.is_full()); i += stride) {
    const std::size_t row = i / cloud.width, column = i % cloud.width;
    if (row + 1 == cloud.height || column + 1 == cloud.width) continue;
    const Eigen::Vector3d p = point_at(cloud, row, column);
    across.add(p, point_at(cloud, row, column + 1));
    down.add(p, point_at(cloud, row + 1, column));
  }
  // All around, neighbours would be 2 pi / width and pi / height apart; cameras see less.
  constexpr double kFewTimes = 2.0;
  return across.median() <= kFewTimes * 2.0 * kPi / static_cast<double>(cloud.width) &&
         down.median() <= kFewTimes * kPi / static_cast<double>(cloud.height);
}

}  // namespace ist
