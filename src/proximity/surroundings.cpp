#include "internal/proximity/surroundings.h"

#include <algorithm>
#include <cmath>

namespace ist {
namespace {

// Points along each axis of the grid; a share is known to about 3 % then.
constexpr int kSampled = 13;

}  // namespace

Surroundings::Surroundings(const LinkModel& link, double skin, double distance) {
  if (!link.usable() || link.tree.empty()) return;
  const double half = link.tree.radius() + distance;
  const double step = 2.0 * half / kSampled;
  for (int i = 0; i < kSampled * kSampled * kSampled; ++i) {
    const Eigen::Array3i cell(i % kSampled, i / kSampled % kSampled, i / kSampled / kSampled);
    const Eigen::Vector3d p_L =
        link.tree.center().array() - half + step * (cell.cast<double>() + 0.5);
    const double apart = link.tree.cover_distance(p_L);
    if (apart > std::max(skin, link.tree.interior_gap()) && apart <= distance) {
      points_.push_back(p_L);
    }
  }
}

SeenShare Surroundings::look(const SeenSpace& seen, const Eigen::Isometry3d& X_ML,
                             double now) const {
  SeenShare result;
  if (points_.empty()) return result;
  std::size_t count = 0;
  for (const Eigen::Vector3d& p_L : points_) {
    const double time = seen.time_seen(X_ML * p_L);
    if (std::isnan(time)) continue;
    ++count;
    result.age = std::fmax(result.age, std::max(now - time, 0.0));
  }
  result.share = static_cast<double>(count) / static_cast<double>(points_.size());
  return result;
}

}  // namespace ist
