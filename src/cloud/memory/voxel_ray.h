#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
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

/// Visits the voxels that a ray passes from its origin on, but for that of its end (Amanatides and
/// Woo 1987), with the roundings of octomap's computeRayKeys(), so that the same voxels come.
/// @param visit  called with each key; false ends the ray
/// @returns false when an end is outside of all keys
template <typename Visit>
bool walk_ray(const VoxelScale& scale, const Eigen::Vector3f& origin, const Eigen::Vector3f& end,
              const Visit& visit) {
  VoxelKey first, last;
  if (!scale.key(origin, &first) || !scale.key(end, &last)) return false;
  if (first == last || !visit(first)) return true;
  Eigen::Vector3f direction = end - origin;
  const auto length = static_cast<float>(octomap_norm(direction));
  std::array<std::int32_t, 3> at = {first.x, first.y, first.z}, step{};
  std::array<double, 3> next{}, width{};  // [m] along the ray: to the next border, and between two
  for (int i = 0; i < 3; ++i) {
    direction[i] /= length;
    step[i] = direction[i] > 0.0F ? 1 : direction[i] < 0.0F ? -1 : 0;
    if (step[i] == 0) {
      next[i] = width[i] = std::numeric_limits<double>::max();
      continue;
    }
    double border = scale.middle(at[i]);
    border += static_cast<double>(static_cast<float>(step[i] * scale.resolution() * 0.5));
    next[i] = (border - origin[i]) / direction[i];
    width[i] = scale.resolution() / std::fabs(static_cast<double>(direction[i]));
  }
  for (;;) {
    const int axis = next[0] < next[1] ? next[0] < next[2] ? 0 : 2 : next[1] < next[2] ? 1 : 2;
    at[axis] += step[axis];
    next[axis] += width[axis];
    const VoxelKey key{at[0], at[1], at[2]};
    if (key == last) return true;
    if (std::min({next[0], next[1], next[2]}) > length) return true;  // the end was missed
    if (!visit(key)) return true;
  }
}

}  // namespace ist
