#include "contact/kept_share.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "internal/cloud/point_bvh.h"
#include "ist_proximity/contact/contact_volume.h"

namespace ist {
namespace {

// Sixteen numbers side by side; Eigen turns them into SIMD, square roots included.
using Lanes = Eigen::Array<float, kPointWidth, 1>;
using LaneMap = Eigen::Map<const Lanes, Eigen::Aligned16>;

constexpr std::size_t kStackSize = 160;  // 16 on each of the levels that 2^31 tiles can have

Lanes squared_distance(const BoxNode& node, const Eigen::Vector3f& p) {
  const auto outside = [](const float* min, const float* max, float v) {
    return Lanes((LaneMap(min) - v).max(v - LaneMap(max)).max(0.0F));
  };
  const Lanes x = outside(node.min_x, node.max_x, p.x());
  const Lanes y = outside(node.min_y, node.max_y, p.y());
  const Lanes z = outside(node.min_z, node.max_z, p.z());
  return x * x + y * y + z * z;
}

// lens_volume, without the factor pi / 12, of sixteen spheres of radius R and one of radius r.
float lenses(const PointTile& tile, const Eigen::Vector3f& p, float R, float r) {
  const Lanes x = p.x() - LaneMap(tile.x), y = p.y() - LaneMap(tile.y), z = p.z() - LaneMap(tile.z);
  const float difference = R - r;
  const Lanes apart = (x * x + y * y + z * z).sqrt().max(std::abs(difference));
  const Lanes s = (R + r - apart).max(0.0F);
  const Lanes q = difference / apart.max(1e-12F);
  // Unused slots are far away: 0 times a number that is finite.
  return (s.square() * (apart + 2.0F * (R + r) - 3.0F * difference * q)).sum();
}

}  // namespace

double point_sphere_radius(const CloudSnapshot& cloud) {
  return kPointSphereRadius * cloud.thinning;
}

double kept_share(const Eigen::Vector3d& p_F, double radius, SnapshotSpan clouds) {
  const auto r = static_cast<float>(radius);
  float shared = 0.0F;
  for (const CloudSnapshot* cloud : clouds) {
    const PointBvh& index = cloud->coarse.bvh();
    if (index.empty()) continue;
    const auto R = static_cast<float>(point_sphere_radius(*cloud));
    const float reach = (R + r) * (R + r);
    const Eigen::Vector3f p =
        (index.X_FO().linear().transpose() * (p_F - index.X_FO().translation())).cast<float>();
    PointTile room;
    std::array<std::int32_t, kStackSize> stack;
    std::size_t top = 0;
    stack[top++] = index.root();
    while (top > 0) {
      const std::int32_t child = stack[--top];
      if (child < 0) {
        shared += lenses(index.tile(static_cast<std::size_t>(~child), &room), p, R, r);
        continue;
      }
      const BoxNode& node = index.nodes()[static_cast<std::size_t>(child)];
      const Lanes squared = squared_distance(node, p);
      for (int k = 0; k < node.count; ++k) {
        if (squared[k] < reach) stack[top++] = node.child[k];
      }
    }
  }
  const float own = 16.0F * r * r * r;                      // without pi / 12
  return static_cast<double>(own / std::max(shared, own));  // rounding could make its own lens less
}

}  // namespace ist
