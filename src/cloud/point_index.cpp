#include "ist_proximity/cloud/point_index.h"

#include "cloud/point_index_builder.h"

namespace ist {

void PointIndex::build(const Eigen::Vector3d& origin, const float* x, const float* y,
                       const float* z, const std::uint32_t* id, std::size_t n) {
  std::vector<CloudPoint> points(n);
  for (std::size_t i = 0; i < n; ++i) points[i] = {x[i], y[i], z[i], id[i]};
  PointIndexBuilder().build(Eigen::Isometry3d(Eigen::Translation3d(origin)), points.data(), n, {},
                            this);
}

}  // namespace ist
