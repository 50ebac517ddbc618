#include <memory>
#include <vector>

#include "cloud/index/point_bvh_builder.h"
#include "internal/cloud/point_bvh.h"
#include "ist_proximity/cloud/cloud_snapshot.h"

namespace ist {

PointIndex::PointIndex() = default;
PointIndex::PointIndex(const PointIndex& other) { *this = other; }
PointIndex::PointIndex(PointIndex&&) noexcept = default;
PointIndex& PointIndex::operator=(PointIndex&&) noexcept = default;
PointIndex::~PointIndex() = default;

PointIndex& PointIndex::operator=(const PointIndex& other) {
  if (this != &other) bvh() = other.bvh();
  return *this;
}

void PointIndex::build(const Eigen::Vector3d& origin, const float* x, const float* y,
                       const float* z, const std::uint32_t* id, std::size_t n) {
  std::vector<CloudPoint> points(n);
  for (std::size_t i = 0; i < n; ++i) points[i] = {x[i], y[i], z[i], id[i]};
  PointBvhBuilder().build(Eigen::Isometry3d(Eigen::Translation3d(origin)), points.data(), n, {},
                          &bvh());
}

bool PointIndex::empty() const { return bvh().empty(); }
std::size_t PointIndex::size() const { return bvh().size(); }
const Eigen::Isometry3d& PointIndex::X_FO() const { return bvh().X_FO(); }
Eigen::AlignedBox3f PointIndex::bounds() const { return bvh().bounds(); }
std::size_t PointIndex::memory() const { return bvh().memory(); }
void PointIndex::clear() {
  if (bvh_ != nullptr) bvh_->clear();
}
std::uint64_t PointIndex::build_id() const { return bvh().build_id(); }

const PointBvh& PointIndex::bvh() const {
  static const PointBvh kEmpty;
  return bvh_ != nullptr ? *bvh_ : kEmpty;
}

PointBvh& PointIndex::bvh() {
  if (bvh_ == nullptr) bvh_ = std::make_unique<PointBvh>();
  return *bvh_;
}

}  // namespace ist
