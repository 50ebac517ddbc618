#include "cloud/index/unorganized_cloud.h"

#include <algorithm>
#include <array>

#include "cloud/filters/crop.h"
#include "cloud/format/point_reader.h"

namespace ist {
namespace {

using Sample = std::array<CloudPoint, PointCells::kSample>;

// The same cloud as a single row, where its rows follow each other without padding or it is a
// single column: full batches are read faster.
RawCloud flattened(RawCloud cloud) {
  if (cloud.depth != DepthType::kNone) return cloud;  // each row has its own rays
  if (cloud.width == 1) {
    cloud.point_step = cloud.row_step;
  } else if (cloud.row_step != cloud.width * cloud.point_step) {
    return cloud;
  }
  cloud.width *= cloud.height;
  cloud.height = 1;
  return cloud;
}

// Takes some of the points that are kept. @returns how many
std::size_t take_sample(const RawCloud& cloud, const CropParameters& crop, Sample* sample) {
  // An odd stride: rows of a scanner have even lengths, and samples are to spread over the columns.
  const std::size_t stride = cloud.size() / sample->size() | 1U;
  std::size_t count = 0;
  for (std::size_t i = 0; i < cloud.size() && count < sample->size(); i += stride) {
    const Eigen::Vector3d p_S = point_at(cloud, i / cloud.width, i % cloud.width);
    const double range_sq = p_S.squaredNorm();
    if (!(range_sq >= crop.min_range_sq && range_sq <= crop.max_range_sq)) continue;
    if (!((p_S - crop.region_center).squaredNorm() <= crop.region_radius_sq)) continue;
    const Eigen::Vector3f p = (crop.X_OS * p_S).cast<float>();
    (*sample)[count++] = {p.x(), p.y(), p.z(), 0};
  }
  return count;
}

}  // namespace

std::size_t index_unorganized(const RawCloud& cloud, const CropParameters& crop,
                              const CloudFilters& filters, NearRegion* region,
                              PointBvhBuilder* builder, PointBvh* bvh, IngestCounts* counts) {
  const RawCloud points = flattened(cloud);
  Sample sample;
  PointCells& cells = builder->cells();
  cells.start(sample.data(), take_sample(points, crop, &sample), points.size());
  CropBatch batch;
  std::uint32_t id = 0;
  std::size_t kept = 0;
  for (std::size_t row = 0; row < points.height; ++row) {
    for (std::size_t column = 0; column < points.width; column += kCropBatch) {
      const std::size_t count = std::min(kCropBatch, points.width - column);
      const std::size_t here = crop_points(points, row, column, count, crop, &batch, counts);
      if (here > 0) cells.add(batch, count, id);
      kept += here;
      id += static_cast<std::uint32_t>(count);
    }
  }
  PointFilter drop;
  BoxFilter may_drop, is_distant;
  SelfFilter* const on_robot = filters.on_robot;
  const ZoneFilter* const zones = filters.zones;
  const auto is_in_zone = [zones](const PaddedBox& box) {
    return zones != nullptr && zones->test(box) != ZoneFilter::Verdict::kNone;
  };
  if (on_robot != nullptr) {
    drop = [on_robot](const PointTile& tile, const PaddedBox& box) {
      return on_robot->points_on_robot(tile, box);
    };
    may_drop = [on_robot](const PaddedBox& box) { return on_robot->begin_group(box); };
  }
  if (zones != nullptr) {
    drop = [zones, counts, on_robot = drop](const PointTile& tile, const PaddedBox& box) {
      return with_zones(*zones, tile, on_robot ? on_robot(tile, box) : 0, counts);
    };
    may_drop = [is_in_zone, on_robot = may_drop](const PaddedBox& box) {
      const bool is_near_robot = on_robot && on_robot(box);
      return is_in_zone(box) || is_near_robot;
    };
  }
  if (region != nullptr) {
    cells.for_each_first([region](const CloudPoint& p) { region->add({p.x, p.y, p.z}); });
    region->finish();
    is_distant = [region, is_in_zone](const PaddedBox& box) {
      return region->is_outside(box) && !is_in_zone(box);
    };
  }
  builder->build_from_cells(crop.X_FO, drop, may_drop, is_distant, bvh);
  return kept;
}

}  // namespace ist
