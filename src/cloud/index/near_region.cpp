#include "cloud/index/near_region.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// [m/s] Few links of arms move faster.
constexpr double kSpeed = 2.0;
// [m] Limits of a link's motion until the next cloud; the larger one where the time is not known.
constexpr double kLeastMotion = 0.1, kMostMotion = 1.0;

}  // namespace

void NearRegion::start(const std::vector<SelfFilter::Link>& links, double search_distance,
                       double stamp) {
  const double period = stamp - stamp_;
  motion_ = static_cast<float>(period > 0.0 ? std::clamp(kSpeed * period, kLeastMotion, kMostMotion)
                                            : kMostMotion);
  stamp_ = stamp;
  search_distance_ = static_cast<float>(search_distance);
  links_.resize(links.size());
  for (std::size_t i = 0; i < links.size(); ++i) {
    const SphereNode& root = links[i].tree->nodes().front();
    Link& link = links_[i];
    link.link = &links[i];
    const Eigen::Isometry3d X_OL = links[i].X_LO.inverse();
    for (int k = 0; k < kSphereWidth; ++k) {
      const bool is_used = k < root.count;
      const Eigen::Vector3d p_L =
          is_used ? Eigen::Vector3d(root.x[k], root.y[k], root.z[k]) : Eigen::Vector3d::Zero();
      const Eigen::Vector3f p_O = (X_OL * p_L).cast<float>();
      link.x[k] = p_O.x();
      link.y[k] = p_O.y();
      link.z[k] = p_O.z();
      link.radius[k] = is_used ? root.radius[k] : -kFarAway;
    }
    link.nearest = std::numeric_limits<float>::infinity();
  }
}

void NearRegion::add(const Eigen::Vector3f& p_O) {
  for (Link& link : links_) {
    const Spheres sq =
        (link.x - p_O.x()).square() + (link.y - p_O.y()).square() + (link.z - p_O.z()).square();
    link.to_spheres = (sq.sqrt() - link.radius).minCoeff();
    if (!(link.to_spheres > link.link->clear_distance)) return;  // may be the robot's
  }
  for (Link& link : links_) {
    if (!(link.to_spheres < link.nearest)) continue;
    link.nearest = link.to_spheres;
    link.p_O = p_O;
  }
}

// [m] No obstacle that is farther from the link is its nearest one. Infinity: none is known.
float NearRegion::distance_of_nearest(const Link& link) {
  if (!std::isfinite(link.nearest)) return link.nearest;
  const Eigen::Vector3d p_L = link.link->X_LO * link.p_O.cast<double>();
  const double distance =
      distance_outside(*link.link->solid, p_L, std::numeric_limits<double>::infinity()).distance;
  return static_cast<float>(distance);
}

void NearRegion::finish() {
  for (Link& link : links_) {
    const float nearest = distance_of_nearest(link);
    const float looked_at = std::isfinite(nearest) ? std::min(nearest, search_distance_) : nearest;
    const Spheres reach = link.radius + (std::max(looked_at, link.link->clear_distance) + motion_);
    link.reach_sq = (link.radius >= 0.0F).select(reach.square(), -1.0F);
  }
}

bool NearRegion::is_outside(const PaddedBox& box) const {
  const auto off = [](const Spheres& center, float min, float max) {
    return (min - center).max(center - max).max(0.0F);
  };
  return !links_.empty() && std::all_of(links_.begin(), links_.end(), [&](const Link& link) {
    const Spheres sq = off(link.x, box.min[0], box.max[0]).square() +
                       off(link.y, box.min[1], box.max[1]).square() +
                       off(link.z, box.min[2], box.max[2]).square();
    return (sq > link.reach_sq).all();
  });
}

}  // namespace ist
