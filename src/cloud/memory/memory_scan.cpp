#include "internal/cloud/memory_scan.h"

#include <cmath>
#include <vector>

#include "cloud/format/depth_reader.h"
#include "cloud/format/point_reader.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/cloud/depth_image.h"

namespace ist {
namespace {

// Rays are cut a little before the largest range, so that rounding lets none be longer.
constexpr double kCut = 1.0 - 1e-6;

// Notes the points of a snapshot, by number in the message.
void note_points(const CloudSnapshot& snapshot, std::vector<bool>* kept) {
  PointTile scratch;
  const PointBvh& points = snapshot.index.bvh();
  for (std::size_t i = 0; i < points.tile_count(); ++i) {
    const PointTile& tile = points.tile(i, &scratch);
    for (int k = 0; k < tile.count; ++k) (*kept)[tile.id[k]] = true;
  }
}

// The points of a row, in the sensor frame.
void read_row(const RawCloud& cloud, std::size_t row, Eigen::Matrix3Xd* points) {
  if (cloud.depth == DepthType::kNone) {
    for (std::size_t c = 0; c < cloud.width; ++c) {
      points->col(static_cast<Eigen::Index>(c)) = point_at(cloud, row, c);
    }
    return;
  }
  Eigen::Matrix<double, 3, Eigen::Dynamic, Eigen::RowMajor> rows(3, points->cols());
  read_depth_pixels(cloud, row, 0, cloud.width, rows.row(0).data(), rows.row(1).data(),
                    rows.row(2).data());
  *points = rows;
}

}  // namespace

void read_memory_scan(const RawCloud& cloud, const CloudSnapshot& snapshot,
                      const Eigen::Isometry3d& X_MS, double min_range, double max_range,
                      MemoryScan* scan, Span<const CloudSnapshot> in_zones) {
  scan->origin = X_MS.translation().cast<float>();
  scan->stamp = snapshot.stamp;
  scan->hits.clear();
  scan->free_ends.clear();
  std::vector<bool> kept(cloud.size(), false);
  note_points(snapshot, &kept);
  for (const CloudSnapshot& zone : in_zones) note_points(zone, &kept);
  Eigen::Matrix3Xd points(3, static_cast<Eigen::Index>(cloud.width));
  for (std::size_t row = 0; row < cloud.height; ++row) {
    read_row(cloud, row, &points);
    for (std::size_t column = 0; column < cloud.width; ++column) {
      Eigen::Vector3d p_S = points.col(static_cast<Eigen::Index>(column));
      if (kept[row * cloud.width + column]) {
        scan->hits.push_back((X_MS * p_S).cast<float>());
        continue;
      }
      double range = p_S.norm();
      if (std::isnan(range)) continue;
      if (!p_S.allFinite()) {
        if (cloud.depth == DepthType::kNone) continue;  // the direction is not known
        p_S = Eigen::Vector3d(cloud.rays->x[column], cloud.rays->y[row], 1.0);
        range = p_S.norm();
        p_S *= max_range * kCut / range;
      } else if (range < min_range || range > snapshot.believed_range) {
        continue;
      } else if (range > max_range) {
        p_S *= max_range * kCut / range;
      }
      scan->free_ends.push_back((X_MS * p_S).cast<float>());
    }
  }
}

}  // namespace ist
