#include "support/box_oracle.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>

#include "support/random_links.h"

namespace ist::test {

BoxOracle::BoxOracle(const TriangleMesh& mesh)
    : triangles_(triangles_of(one(mesh))), surface_(triangles_) {}

double BoxOracle::distance(const PlacedBox& placed) const {
  const Eigen::Isometry3d X_inv = placed.X.inverse();
  const auto is_inside = [&](const auto& t) { return placed.box.contains(X_inv * t.p[0]); };
  if (std::any_of(triangles_.begin(), triangles_.end(), is_inside)) return 0.0;
  const Eigen::Isometry3d X = placed.X * Eigen::Translation3d(placed.box.center());
  return surface_.distance(TriangleGroups(triangles_of({{Box{placed.box.sizes()}, X, "box"}})),
                           Eigen::Isometry3d::Identity());
}

CloudSnapshot make_map(const std::vector<Eigen::AlignedBox3d>& boxes_M,
                       const Eigen::Isometry3d& X_FM) {
  auto index = std::make_shared<BoxIndex>();
  index->build(boxes_M);
  CloudSnapshot snapshot;
  snapshot.boxes = index;
  snapshot.X_FM = X_FM;
  snapshot.counts.received = snapshot.counts.used = static_cast<std::uint32_t>(boxes_M.size());
  return snapshot;
}

Eigen::AlignedBox3d random_leaf(Rng* rng, double space, double resolution, int levels) {
  const int level =
      std::min(levels - 1, static_cast<int>(-std::log2(uniform(rng, 1e-3, 1.0)) / 1.5));
  const double size = resolution * static_cast<double>(1 << level);
  Eigen::Vector3d low = random_vector(rng, space);
  for (double& v : low) v = size * std::floor(v / size);
  return {low, low + Eigen::Vector3d::Constant(size)};
}

std::vector<Eigen::AlignedBox3d> random_leaves(Rng* rng, int count, double space, double resolution,
                                               int levels) {
  std::vector<Eigen::AlignedBox3d> boxes(static_cast<std::size_t>(count));
  for (Eigen::AlignedBox3d& box : boxes) box = random_leaf(rng, space, resolution, levels);
  return boxes;
}

}  // namespace ist::test
