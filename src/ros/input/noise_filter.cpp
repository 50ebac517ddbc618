#include "ros/input/noise_filter.h"

#ifdef IST_PROXIMITY_WITH_PCL
#include <pcl/filters/radius_outlier_removal.h>
#include <pcl/point_types.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <vector>

#include "internal/cloud/largest_range.h"

namespace ist {

#ifdef IST_PROXIMITY_WITH_PCL

namespace {

// Coordinates stay float64, so that ingest sees the same values as without the filter.
using Point = std::array<double, 3>;

template <typename Number>
double read_number(const std::uint8_t* from, bool swap_bytes) {
  std::array<std::uint8_t, sizeof(Number)> bytes;
  std::memcpy(bytes.data(), from, sizeof(Number));
  if (swap_bytes) std::reverse(bytes.begin(), bytes.end());
  Number number;
  std::memcpy(&number, bytes.data(), sizeof(Number));
  return number;
}

Point point_at(const RawCloud& cloud, std::size_t row, std::size_t column) {
  const std::uint8_t* point = cloud.data + row * cloud.row_step + column * cloud.point_step;
  const auto read = cloud.is_double ? &read_number<double> : &read_number<float>;
  return {read(point + cloud.x, cloud.swap_bytes), read(point + cloud.y, cloud.swap_bytes),
          read(point + cloud.z, cloud.swap_bytes)};
}

// False for NaN and infinity, too. Coordinates within kLargestRange are finite in float: PCL ends
// the program when it is given others.
bool is_within(const Point& p, double range) {
  const double range_sq = p[0] * p[0] + p[1] * p[1] + p[2] * p[2];
  const double limit = std::min(range, kLargestRange);
  return range_sq <= limit * limit;
}

RawCloud view(const std::vector<Point>& points, const RawCloud& like) {
  RawCloud raw;
  raw.data = reinterpret_cast<const std::uint8_t*>(points.data());
  raw.width = like.width;
  raw.height = like.height;
  raw.point_step = sizeof(Point);
  raw.row_step = like.width * sizeof(Point);
  raw.y = sizeof(double);
  raw.z = 2 * sizeof(double);
  raw.is_double = true;
  return raw;
}

}  // namespace

struct NoiseFilter::Impl {
  pcl::RadiusOutlierRemoval<pcl::PointXYZ> filter{true};
  pcl::PointCloud<pcl::PointXYZ>::Ptr finite{new pcl::PointCloud<pcl::PointXYZ>};
  std::vector<std::size_t> original;  ///< by index in `finite`: index in `points`
  std::vector<Point> points;
  std::vector<int> kept;  ///< `int` is the index type of PCL 1.10, and later versions accept it
};

NoiseFilter::NoiseFilter(const NoiseFilterConfig& config) : impl_(std::make_unique<Impl>()) {
  impl_->filter.setRadiusSearch(config.radius);
  impl_->filter.setMinNeighborsInRadius(config.neighbors);
}

RawCloud NoiseFilter::run(const RawCloud& cloud, double max_range, std::uint32_t* dropped) {
  Impl& my = *impl_;
  my.points.clear();
  my.original.clear();
  my.finite->clear();  // an unorganized cloud, so that PCL does not search it as an image
  for (std::size_t row = 0; row < cloud.height; ++row) {
    for (std::size_t column = 0; column < cloud.width; ++column) {
      const Point p = point_at(cloud, row, column);
      if (is_within(p, max_range)) {
        my.original.push_back(my.points.size());
        my.finite->emplace_back(static_cast<float>(p[0]), static_cast<float>(p[1]),
                                static_cast<float>(p[2]));
      }
      my.points.push_back(p);
    }
  }
  *dropped = 0;
  if (my.original.empty()) return view(my.points, cloud);
  my.filter.setInputCloud(my.finite);
  my.filter.filter(my.kept);
  for (const int index : *my.filter.getRemovedIndices()) {
    my.points[my.original[static_cast<std::size_t>(index)]].fill(
        std::numeric_limits<double>::quiet_NaN());
    ++*dropped;
  }
  return view(my.points, cloud);
}

#else

struct NoiseFilter::Impl {};

NoiseFilter::NoiseFilter(const NoiseFilterConfig&) {
  throw std::logic_error("NoiseFilter: built without PCL");
}

RawCloud NoiseFilter::run(const RawCloud& cloud, double, std::uint32_t*) { return cloud; }

#endif

NoiseFilter::~NoiseFilter() = default;

}  // namespace ist
