#include "cloud/index/list_tiles.h"

#include <algorithm>
#include <array>

#include "cloud/filters/crop.h"
#include "cloud/format/point_reader.h"

namespace ist {
namespace {

using Sample = std::array<CloudPoint, PointCells::kSample>;

// One row of points where the rows follow each other without gaps, and a column is a row as well:
// blocks are to be full.
RawCloud flattened(RawCloud cloud) {
  if (cloud.width == 1) {
    cloud.point_step = cloud.row_step;
  } else if (cloud.row_step != cloud.width * cloud.point_step) {
    return cloud;
  }
  cloud.width *= cloud.height;
  cloud.height = 1;
  return cloud;
}

// Some of the points that are kept. @returns how many
std::size_t take_sample(const RawCloud& cloud, const CropPose& pose, Sample* sample) {
  // Odd: rows of a scanner have even lengths, and are not to be met at the same place each time.
  const std::size_t stride = cloud.size() / sample->size() | 1U;
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.size() && count < sample->size(); i += stride) {
    const Eigen::Vector3d p_S = point_at(cloud, i / cloud.width, i % cloud.width);
    const double range_sq = p_S.squaredNorm();
    if (!(range_sq >= pose.min_range_sq && range_sq <= pose.max_range_sq)) continue;
    if (!((p_S - pose.region_center).squaredNorm() <= pose.region_radius_sq)) continue;
    const Eigen::Vector3f p = (pose.X_OS * p_S).cast<float>();
    (*sample)[count++] = {p.x(), p.y(), p.z(), 0};
  }
  return count;
}

}  // namespace

std::size_t index_list(const RawCloud& cloud, const CropPose& pose, const SelfFilter* on_robot,
                       PointBvhBuilder* builder, PointBvh* index, IngestCounts* counts) {
  const RawCloud list = flattened(cloud);
  Sample sample;
  PointCells& cells = builder->cells();
  cells.start(sample.data(), take_sample(list, pose, &sample), list.size());
  CropBlock block;
  std::uint32_t id = 0;
  std::size_t kept = 0;
  for (std::size_t row = 0; row < list.height; ++row) {
    for (std::size_t column = 0; column < list.width; column += kCropBlock) {
      const std::size_t count = std::min(kCropBlock, list.width - column);
      const std::size_t here = crop_points(list, row, column, count, pose, &block, counts);
      if (here > 0) cells.add(block, count, id);
      kept += here;
      id += static_cast<std::uint32_t>(count);
    }
  }
  if (on_robot == nullptr) {
    builder->build(pose.X_FO, {}, {}, index);
  } else {
    builder->build(
        pose.X_FO, on_robot->as_filter(),
        [on_robot](const PaddedBox& box) { return on_robot->may_drop(box); }, index);
  }
  return kept;
}

}  // namespace ist
