#include <algorithm>
#include <array>
#include <cstddef>

#include "cloud/index/block_bounds.h"
#include "cloud/index/organized_cloud.h"

namespace ist {
namespace {

constexpr std::size_t kSampledBlocks = 64;

// Numbers of the sampled blocks of 4 x 4 pixels.
class BlockValues {
 public:
  void add(float value) { values_[size_++] = value; }
  std::size_t size() const { return size_; }
  float quantile(std::size_t tenths) {
    const auto at = values_.begin() + static_cast<std::ptrdiff_t>(size_ * tenths / 10);
    std::nth_element(values_.begin(), at, values_.begin() + static_cast<std::ptrdiff_t>(size_));
    return *at;
  }
  /// The range of the middle four fifths.
  float span() { return quantile(9) - quantile(1); }

 private:
  std::array<float, 2 * kSampledBlocks> values_;
  std::size_t size_ = 0;
};

}  // namespace

bool is_organized(const RawCloud& cloud, const CropParameters& crop) {
  if (cloud.width < kBlockSide || cloud.height < kTileSide) return false;
  const std::size_t across = cloud.width / kTileSide, blocks = across * (cloud.height / kTileSide);
  // Not a divisor of the row: the samples are to be spread over the columns, too.
  const std::size_t step = std::max<std::size_t>(1, blocks / kSampledBlocks) | 1U;
  std::array<CropBatch, kTileSide> rows;
  BlockValues size_sq, x, y, z;
  std::size_t kept = 0, received = 0;
  IngestCounts unused;
  for (std::size_t i = 0; i < blocks; i += step) {
    Eigen::AlignedBox3f box;
    std::size_t here = 0;
    for (std::size_t row = 0; row < kTileSide; ++row) {
      here += crop_points(cloud, i / across * kTileSide + row, i % across * kTileSide, kTileSide,
                          crop, &rows[row], &unused);
      for (std::size_t k = 0; k < kTileSide; ++k) {
        const CropBatch& r = rows[row];
        if (r.x[k] == r.x[k]) box.extend(Eigen::Vector3f(r.x[k], r.y[k], r.z[k]));
      }
    }
    kept += here;
    received += kTileSide * kTileSide;
    if (here < kTileSide * kTileSide / 2) continue;
    size_sq.add(box.diagonal().squaredNorm());
    x.add(box.center().x());
    y.add(box.center().y());
    z.add(box.center().z());
  }
  if (size_sq.size() < kSampledBlocks / 8) return false;
  const Eigen::Vector3f spread(x.span(), y.span(), z.span());
  // On a surface of that size, n points make squares of sixteen this large; a few times as large is
  // accepted.
  const float points =
      static_cast<float>(cloud.size()) * static_cast<float>(kept) / static_cast<float>(received);
  constexpr float kFewTimes = 4.0F;
  const float largest_sq =
      kFewTimes * kFewTimes * spread.squaredNorm() * static_cast<float>(kPointWidth) / points;
  return size_sq.quantile(5) <= largest_sq;
}

}  // namespace ist
