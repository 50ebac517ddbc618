#include "internal/cloud/noise_filter.h"

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cstring>
#include <vector>

#include "cloud/format/point_reader.h"
#include "cloud/index/point_bvh_builder.h"
#include "internal/bvh/box_node.h"
#include "internal/bvh/traversal_stack.h"
#include "internal/cloud/largest_range.h"
#include "internal/cloud/point_bvh.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// Boxes are in float: relative to the largest coordinate, they may be this far off.
constexpr float kBoxSlack = 1e-6F;

// Pixels on either side, in the row and in the column, that are looked at before a search.
constexpr std::size_t kWindow = 2;
// The same where the cloud is a single row.
constexpr std::size_t kRowWindow = 8;

// False for NaN and infinity, too.
bool is_within(const Eigen::Vector3d& p, double range) {
  const double limit = std::min(range, kLargestRange);
  return p.squaredNorm() <= limit * limit;
}

// [m^2] The squared distance from a point to a child's box.
float distance_sq(const BoxNode& node, int child, const Eigen::Vector3f& p) {
  const float x = std::max({node.min_x[child] - p.x(), p.x() - node.max_x[child], 0.0F});
  const float y = std::max({node.min_y[child] - p.y(), p.y() - node.max_y[child], 0.0F});
  const float z = std::max({node.min_z[child] - p.z(), p.z() - node.max_z[child], 0.0F});
  return x * x + y * y + z * z;
}

}  // namespace

struct NoiseFilter::Impl {
  NoiseFilterConfig config;
  double radius_sq = 0.0;
  std::size_t width = 0, height = 0;
  std::vector<Eigen::Vector3d> points;   // by their numbers in the message
  std::vector<bool> is_counted;          // the same: whether a point may be a neighbor
  std::vector<std::uint32_t> undecided;  // numbers of the points that need a search
  std::vector<CloudPoint> indexed;       // those that may be neighbors, from `origin`
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  float slack = 0.0F;  // [m] of the index's boxes
  PointBvhBuilder builder;
  PointBvh index;
  using Stack = TraversalStack<std::int32_t, stack_capacity(kMaxBoxLevels, kBoxWidth)>;

  void read(const RawCloud& cloud, double counted_range);
  bool is_neighbor(std::uint32_t a, std::uint32_t b) const {
    return (points[a] - points[b]).squaredNorm() <= radius_sq;
  }
  bool has_neighbors_beside(std::size_t row, std::size_t column) const;
  void find_undecided(double max_range);
  void build_index();
  bool has_neighbors(std::uint32_t point) const;
  bool count_in_tile(const PointTile& tile, std::uint32_t point, int* count) const;
  RawCloud view(const RawCloud& of) const;
};

void NoiseFilter::Impl::read(const RawCloud& cloud, double counted_range) {
  width = cloud.width;
  height = cloud.height;
  points.clear();
  is_counted.clear();
  points.reserve(cloud.size());
  is_counted.reserve(cloud.size());
  for (std::size_t row = 0; row < height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      points.push_back(point_at(cloud, row, column));
      is_counted.push_back(is_within(points.back(), counted_range));
    }
  }
}

// Whether a point has enough neighbors among those beside it in the message. They are distinct
// points of the cloud, so that the answer yes is right wherever they lie.
bool NoiseFilter::Impl::has_neighbors_beside(std::size_t row, std::size_t column) const {
  const std::size_t across = height == 1 ? kRowWindow : kWindow;
  const std::size_t first_row = row - std::min(row, kWindow);
  const std::size_t last_row = std::min(row + kWindow, height - 1);
  const std::size_t first_column = column - std::min(column, across);
  const std::size_t last_column = std::min(column + across, width - 1);
  const auto self = static_cast<std::uint32_t>(row * width + column);
  int count = 0;
  for (std::size_t r = first_row; r <= last_row; ++r) {
    for (std::size_t c = first_column; c <= last_column; ++c) {
      const auto other = static_cast<std::uint32_t>(r * width + c);
      if (other == self || !is_counted[other] || !is_neighbor(self, other)) continue;
      if (++count >= config.neighbors) return true;
    }
  }
  return false;
}

void NoiseFilter::Impl::find_undecided(double max_range) {
  undecided.clear();
  for (std::size_t row = 0; row < height; ++row) {
    for (std::size_t column = 0; column < width; ++column) {
      const std::size_t i = row * width + column;
      if (!is_within(points[i], max_range) || has_neighbors_beside(row, column)) continue;
      undecided.push_back(static_cast<std::uint32_t>(i));
    }
  }
}

void NoiseFilter::Impl::build_index() {
  origin = points[undecided.front()];
  indexed.clear();
  float largest = 0.0F;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!is_counted[i]) continue;
    const Eigen::Vector3f p = (points[i] - origin).cast<float>();
    largest = std::max(largest, p.cwiseAbs().maxCoeff());
    indexed.push_back({p.x(), p.y(), p.z(), static_cast<std::uint32_t>(i)});
  }
  slack = kBoxSlack * largest;
  builder.build(Eigen::Isometry3d::Identity(), indexed.data(), indexed.size(), {}, &index);
}

// @returns true as soon as there are enough
bool NoiseFilter::Impl::count_in_tile(const PointTile& tile, std::uint32_t point,
                                      int* count) const {
  for (int k = 0; k < tile.count; ++k) {
    if (tile.id[k] == point || !is_neighbor(tile.id[k], point)) continue;
    if (++*count >= config.neighbors) return true;
  }
  return false;
}

bool NoiseFilter::Impl::has_neighbors(std::uint32_t point) const {
  const Eigen::Vector3f p = (points[point] - origin).cast<float>();
  const float limit = static_cast<float>(config.radius) * (1.0F + kBoxSlack) + slack;
  int count = 0;
  PointTile scratch;
  Stack stack;
  stack.push(index.root());
  while (!stack.empty()) {
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(stack.pop())];
    for (int k = 0; k < node.count; ++k) {
      if (distance_sq(node, k, p) > limit * limit) continue;
      if (node.child[k] >= 0) {
        stack.push(node.child[k]);
      } else if (count_in_tile(index.tile(static_cast<std::size_t>(~node.child[k]), &scratch),
                               point, &count)) {
        return true;
      }
    }
  }
  return false;
}

// The points as they are now, of a cloud that read() has read.
RawCloud NoiseFilter::Impl::view(const RawCloud& of) const {
  RawCloud raw;
  raw.data = reinterpret_cast<const std::uint8_t*>(points.data());
  raw.width = width;
  raw.height = height;
  raw.point_step = sizeof(Eigen::Vector3d);
  raw.row_step = width * sizeof(Eigen::Vector3d);
  raw.y = sizeof(double);
  raw.z = 2 * sizeof(double);
  raw.is_double = true;
  raw.pixel_angle = of.pixel_angle;
  raw.origin = of.origin;
  raw.from_rays = of.from_rays;
  raw.believed_range = of.believed_range;
  return raw;
}

NoiseFilter::NoiseFilter(const NoiseFilterConfig& config) : impl_(std::make_unique<Impl>()) {
  impl_->config = config;
  impl_->radius_sq = config.radius * config.radius;
}

NoiseFilter::~NoiseFilter() = default;

RawCloud NoiseFilter::run(const RawCloud& cloud, double max_range, std::uint32_t* dropped) {
  Impl& my = *impl_;
  my.read(cloud, max_range + my.config.radius);  // neighbors may be farther than the points
  my.find_undecided(max_range);
  *dropped = 0;
  if (my.undecided.empty()) return my.view(cloud);
  my.build_index();
  std::size_t noise = 0;
  for (const std::uint32_t point : my.undecided) {
    // Points keep their places until all are decided.
    if (!my.has_neighbors(point)) my.undecided[noise++] = point;
  }
  for (std::size_t i = 0; i < noise; ++i) my.points[my.undecided[i]].setConstant(kNaN);
  *dropped = static_cast<std::uint32_t>(noise);
  return my.view(cloud);
}

}  // namespace ist
