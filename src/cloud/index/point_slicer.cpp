#include "cloud/index/point_slicer.h"

#include <Eigen/Core>
#include <algorithm>
#include <numeric>

#include "cloud/index/slice_kernel.h"

namespace ist {

void PointSlicer::reserve(std::size_t n) {
  if (slices_.size() < n + kPointSlack) slices_.resize(2 * (n + kPointSlack));
}

bool PointSlicer::sort(const CloudPoint* from, std::size_t n, CloudPoint* to) {
  constexpr std::size_t kFew = 128, kFewSlices = 32;
  const std::size_t count = n <= kFew ? kFewSlices : kMostSlices;
  dense_begin_ = dense_end_ = 0;
  reserve(n);
  if (!find_slices(from, n, static_cast<std::int32_t>(count), slices_.data(), &shape_))
    return false;
  std::fill_n(at_.begin(), count, 0U);
  const std::int32_t* slices = slices_.data();
  for (std::size_t i = 0; i < n; ++i) ++at_[static_cast<std::size_t>(slices[i])];
  const std::uint32_t most = Eigen::Map<Eigen::Array<std::uint32_t, Eigen::Dynamic, 1>>(
                                 at_.data(), static_cast<Eigen::Index>(count))
                                 .maxCoeff();
  constexpr std::size_t kTile = 16;
  if (most > kTile && 4 * most > n) {
    const auto dense = std::find(at_.begin(), at_.end(), most);
    dense_begin_ = std::accumulate(at_.begin(), dense, std::size_t{0});
    dense_end_ = dense_begin_ + most;
  }
  std::uint32_t begin = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::uint32_t here = at_[k];
    at_[k] = begin;  // grows with every point that is put there
    begin += here;
  }
  for (std::size_t i = 0; i < n; ++i) to[at_[static_cast<std::size_t>(slices[i])]++] = from[i];
  return true;
}

}  // namespace ist
