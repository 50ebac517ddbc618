#include "ist_proximity/repulsion/kept_repulsion.h"

#include <algorithm>
#include <cstring>

#include "repulsion/blend_expansion.h"

namespace ist {
namespace {

// Maps are in the key by their places, too: for a robot that drives they are placed in every cycle.
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

// An expansion may make the mean of unit vectors longer than they are.
RepulsiveWrench mean(const BlendExpansion::Sums& sums, double length) {
  const double scale = length / std::max(sums.weight, sums.wrench.force.norm() * (1.0 - 1e-6));
  return {scale * sums.wrench.force, scale * sums.wrench.torque};
}

}  // namespace

KeptRepulsion::KeptRepulsion(std::size_t link)
    : link_(link), blend_(std::make_unique<BlendExpansion>()) {}
KeptRepulsion::~KeptRepulsion() = default;
KeptRepulsion::KeptRepulsion(KeptRepulsion&&) noexcept = default;
KeptRepulsion& KeptRepulsion::operator=(KeptRepulsion&&) noexcept = default;

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
  const double strength = repulsion_strength(proximity, config);
  BlendExpansion::Sums sums;
  if (is_kept_ && obstacles == obstacles_ && config.smoothing == smoothing_ &&
      blend_->find(X_FL, kKeptMotion * smoothing_ / strength, kMostKeptMotion * smoothing_,
                   &sums)) {
    return mean(sums, length);
  }
  is_kept_ = false;
  RepulsiveWrench blend =
      repulsion.blend(link_, X_FL, clouds, proximity, config, end, blend_.get());
  is_kept_ = blend.force.allFinite() && !blend_->empty();
  obstacles_ = obstacles;
  smoothing_ = config.smoothing;
  return blend;
}

}  // namespace ist
