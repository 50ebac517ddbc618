#pragma once

#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "cloud/memory/voxel_blocks.h"

namespace ist {

/// Conversions between coordinates and keys with octomap's roundings.
class VoxelScale {
 public:
  explicit VoxelScale(double resolution) : resolution_(resolution), per_metre_(1.0 / resolution) {}

  double resolution() const { return resolution_; }

  /// @returns false when the coordinate is outside of all keys; `key` is unchanged then
  bool key(double coordinate, std::int32_t* key) const {
    const double cell = std::floor(per_metre_ * coordinate) + kKeyOrigin;
    if (!(cell >= 0.0 && cell < kKeyEnd)) return false;
    *key = static_cast<std::int32_t>(cell);
    return true;
  }
  bool key(const Eigen::Vector3f& p, VoxelKey* key) const {
    return this->key(p.x(), &key->x) && this->key(p.y(), &key->y) && this->key(p.z(), &key->z);
  }
  bool key(const Eigen::Vector3d& p, VoxelKey* key) const {
    return this->key(p.x(), &key->x) && this->key(p.y(), &key->y) && this->key(p.z(), &key->z);
  }
  /// The middle of a voxel along an axis [m].
  double middle(std::int32_t key) const {
    return (static_cast<double>(key - kKeyOrigin) + 0.5) * resolution_;
  }
  Eigen::Vector3d middle(const VoxelKey& key) const {
    return {middle(key.x), middle(key.y), middle(key.z)};
  }
  /// The lower border of a voxel along an axis [m].
  double border(std::int32_t key) const { return resolution_ * (key - kKeyOrigin); }

 private:
  double resolution_, per_metre_;
};

/// Length of a vector as octomap computes it: squares and their sum in float.
inline double octomap_norm(const Eigen::Vector3f& v) {
  const float square = v.x() * v.x() + v.y() * v.y() + v.z() * v.z();
  return std::sqrt(static_cast<double>(square));
}

/// Steps along one axis of a ray: the coordinate of the voxel, and where along the ray [m] the next
/// border is, with octomap's roundings.
struct RayAxis {
  RayAxis(const VoxelScale& scale, std::int32_t key, float origin, float direction) : at(key) {
    if (direction == 0.0F) return;
    step = direction > 0.0F ? 1 : -1;
    double border = scale.middle(key);
    border += static_cast<double>(static_cast<float>(step * scale.resolution() * 0.5));
    next = (border - origin) / direction;
    width = scale.resolution() / std::fabs(static_cast<double>(direction));
  }
  void go() {
    at += step;
    next += width;
  }

  std::int32_t at, step = 0;
  double next = std::numeric_limits<double>::max(), width = next;
};

/// Visits the voxels that a ray passes from its origin on, but for that of its end (Amanatides and
/// Woo 1987): the same as octomap's computeRayKeys().
/// @param first, last  the keys of origin and end
/// @param visit        called with each key; false ends the ray
template <typename Visit>
void walk_ray(const VoxelScale& scale, const Eigen::Vector3f& origin, const Eigen::Vector3f& end,
              const VoxelKey& first, const VoxelKey& last, const Visit& visit) {
  if (first == last || !visit(first)) return;
  Eigen::Vector3f direction = end - origin;
  const auto length = static_cast<float>(octomap_norm(direction));
  // Ends so close that their distance is zero in float have no direction.
  if (!(length > 0.0F)) return;
  for (int i = 0; i < 3; ++i) direction[i] /= length;
  RayAxis x(scale, first.x, origin.x(), direction.x());
  RayAxis y(scale, first.y, origin.y(), direction.y());
  RayAxis z(scale, first.z, origin.z(), direction.z());
  for (;;) {
    if (x.next < y.next && x.next < z.next) {
      x.go();
    } else if (x.next >= y.next && y.next < z.next) {
      y.go();
    } else {
      z.go();
    }
    const VoxelKey key{x.at, y.at, z.at};
    if (key == last) return;
    // The end was missed, because roundings add up.
    if (x.next > length && y.next > length && z.next > length) return;
    if (!visit(key)) return;
  }
}

}  // namespace ist
