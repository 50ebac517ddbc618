#include "ist_proximity/repulsion/kept_repulsion.h"

#include <cmath>
#include <cstring>

namespace ist {
namespace {

// A shorter vector does not tell its direction well enough to be kept.
constexpr double kLeastLength = 1e-6;

// obstacles_key(), and where maps are: those of a robot that drives are placed anew in every cycle.
std::uint64_t placed_obstacles_key(SnapshotSpan clouds) {
  std::uint64_t key = obstacles_key(clouds);
  for (const CloudSnapshot* cloud : clouds) {
    if (cloud == nullptr || cloud->boxes == nullptr) continue;
    for (int i = 0; i < 12; ++i) {
      std::uint64_t bits = 0;
      const double number = cloud->X_FM(i % 3, i / 3);
      std::memcpy(&bits, &number, sizeof bits);
      key = (key ^ bits) * 1099511628211ULL;
    }
  }
  return key;
}

}  // namespace

KeptRepulsion::KeptRepulsion(const RobotModel& model, std::size_t link) : link_(link) {
  const InnerSphereTree& tree = model.links[link].tree;
  if (tree.empty()) return;
  center_ = tree.center();
  radius_ = tree.radius();
}

// [m] No point of the bounding sphere has moved farther since the last blend: its centre's motion,
// and the chord that the rotation makes at its radius (the largest singular value of a difference
// of two rotations is its Frobenius norm over the root of 2).
double KeptRepulsion::moved(const Eigen::Isometry3d& X_FL) const {
  return (X_FL * center_ - X_FL_ * center_).norm() +
         std::sqrt(0.5) * (X_FL.linear() - X_FL_.linear()).norm() * radius_;
}

RepulsiveWrench KeptRepulsion::update(const Repulsion& repulsion, const Eigen::Isometry3d& X_FL,
                                      SnapshotSpan clouds, const LinkProximity& proximity,
                                      const RepulsionConfig& config, TimePoint end) {
  if (proximity.state == LinkState::kUnknown) {
    forget();
    return RepulsiveWrench::unknown();
  }
  const double length = config.gain * repulsion_strength(proximity, config);
  if (!(length > 0.0)) return {};
  const std::uint64_t obstacles = placed_obstacles_key(clouds);
  // Written so that a pose that is NaN keeps nothing.
  if (is_kept_ && obstacles == obstacles_ && config.smoothing == smoothing_ &&
      moved(X_FL) <= kKeptMotion * smoothing_) {
    return {length * per_length_.force, length * per_length_.torque};
  }
  const RepulsiveWrench blend = repulsion.wrench(link_, X_FL, clouds, proximity, config, end);
  is_kept_ = blend.force.allFinite() && length > kLeastLength;
  if (!is_kept_) return blend;
  X_FL_ = X_FL;
  obstacles_ = obstacles;
  smoothing_ = config.smoothing;
  per_length_ = {blend.force / length, blend.torque / length};
  return blend;
}

}  // namespace ist
