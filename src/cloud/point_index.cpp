#include "ist_proximity/cloud/point_index.h"

#include "cloud/point_index_builder.h"

namespace ist {

void PointIndex::build(const Eigen::Vector3d& origin, const float* x, const float* y,
                       const float* z, const std::uint32_t* id, std::size_t n) {
  PointIndexBuilder().build(origin, x, y, z, id, n, {}, this);
}

}  // namespace ist
