#include "cloud/filters/one_place.h"

#include "cloud/format/point_reader.h"

namespace ist {
namespace {

// More than half of the points are hardly ever less than half of so many samples.
constexpr std::size_t kComparedPoints = 64;

// Goes through every stride-th point in a range that counts.
template <typename Visit>
void visit_points(const RawCloud& cloud, const CropParameters& crop, std::size_t stride,
                  const Visit& visit) {
  for (std::size_t i = 0; i < cloud.size(); i += stride) {
    const Eigen::Vector3d p = point_at(cloud, i / cloud.width, i % cloud.width);
    const double range_sq = p.squaredNorm();
    if (range_sq >= crop.min_range_sq && range_sq <= crop.believed_sq) visit(p);
  }
}

}  // namespace

std::uint32_t points_at_one_place(const RawCloud& cloud, const CropParameters& crop) {
  if (cloud.from_rays) return 0;
  // An odd stride: rows have even lengths, and samples are to spread over the columns.
  const std::size_t stride = cloud.size() / kComparedPoints | 1U;
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  std::size_t votes = 0;  // the only place that can have more than half of the samples wins
  visit_points(cloud, crop, stride, [&](const Eigen::Vector3d& p) {
    if (votes == 0) place = p;
    votes = p == place ? votes + 1 : votes - 1;
  });
  std::size_t there = 0, all = 0;
  const auto count = [&](const Eigen::Vector3d& p) {
    there += p == place ? 1 : 0;
    ++all;
  };
  if (votes > 0) visit_points(cloud, crop, stride, count);
  if (there < 2 || 2 * there <= all) return 0;
  there = all = 0;
  visit_points(cloud, crop, 1, count);
  return 2 * there > all ? static_cast<std::uint32_t>(there) : 0;
}

}  // namespace ist
