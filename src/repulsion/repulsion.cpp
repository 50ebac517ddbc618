#include "ist_proximity/repulsion/repulsion.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>
#include <vector>

#include "internal/cloud/point_bvh.h"
#include "internal/geometry/relative_pose.h"
#include "ist_proximity/repulsion/kept_repulsion.h"
#include "repulsion/blend_expansion.h"
#include "repulsion/blend_kernel.h"
#include "repulsion/coarse_spheres.h"

namespace ist {
namespace {

// A share of the smoothing: an expansion needs the nearest points of those spheres that are at most
// this much farther than the nearest pair. Another sphere does not become the nearest one while
// spheres move by half of this, KeptRepulsion::kMostKeptMotion.
constexpr auto kSlack = static_cast<float>(2.0 * KeptRepulsion::kMostKeptMotion);

PosedSpheres posed(const std::vector<SphereGroup>& groups, const Eigen::Isometry3d& X_OL) {
  PosedSpheres spheres;
  spheres.groups = groups.data();
  spheres.count = groups.size();
  for (int row = 0; row < 3; ++row) {
    for (int i = 0; i < 3; ++i) {
      spheres.R_OL[3 * row + i] = static_cast<float>(X_OL.linear()(row, i));
    }
    spheres.p_OL[row] = static_cast<float>(X_OL.translation()[row]);
  }
  return spheres;
}

// Calls visit(index, spheres, R_FO) for each thinned cloud and each map: the link's spheres are in
// the frame O of the index.
template <typename Visit>
void for_each_index(SnapshotSpan clouds, const std::vector<SphereGroup>& groups,
                    const Eigen::Isometry3d& X_FL, const Visit& visit) {
  for (const CloudSnapshot* cloud : clouds) {
    if (cloud == nullptr) continue;
    const ThinnedCloud thinned = cloud->index.bvh().thinned();
    if (!thinned.empty()) {
      const Eigen::Isometry3d& X_FO = thinned.X_FO();
      visit(thinned, posed(groups, relative_pose(X_FO, X_FL)), X_FO.linear());
    }
    if (cloud->boxes == nullptr || cloud->boxes->empty()) continue;
    const Eigen::Isometry3d X_FO = cloud->X_FM * Eigen::Translation3d(cloud->boxes->origin());
    visit(cloud->boxes->bvh(), posed(groups, relative_pose(X_FO, X_FL)), X_FO.linear());
  }
}

Eigen::Vector3d vector(const float v[3]) { return {v[0], v[1], v[2]}; }

// The sums over all indices, in the fixed frame. A pair's line of action goes through its sphere's
// centre.
struct Total {
  Eigen::Vector3d fallback;  // direction of pairs that have none
  RepulsiveWrench wrench;    // times `weight`
  double weight = 0.0;

  void add(const PairSums& sums, const Eigen::Matrix3d& R_FO) {
    wrench.force += R_FO * vector(sums.force) + static_cast<double>(sums.undirected) * fallback;
    wrench.torque +=
        R_FO * vector(sums.torque) + (R_FO * vector(sums.undirected_arm)).cross(fallback);
    weight += static_cast<double>(sums.weight);
  }
};

// The nearest pair, and where an expansion is wanted the nearest point of each sphere.
float find_nearest(const ThinnedCloud& cloud, const PosedSpheres& spheres,
                   const Eigen::Matrix3d& R_FO, const Band& band, Deadline* deadline,
                   BlendExpansion* expansion) {
  if (expansion == nullptr) return nearest_pair(cloud, spheres, band.nearest, deadline);
  NearestPoints points;
  const float slack = kSlack * band.smoothing;
  const float nearest = nearest_pair(cloud, spheres, band.nearest, deadline, slack, &points);
  expansion->add(points, R_FO);
  return nearest;
}
float find_nearest(const BoxBvh& map, const PosedSpheres& spheres, const Eigen::Matrix3d& /*R_FO*/,
                   const Band& band, Deadline* deadline, BlendExpansion* /*expansion*/) {
  return nearest_pair(map, spheres, band.nearest, deadline);
}

// The sums over pairs, and where an expansion is wanted those of each sphere. A map has no slopes:
// the point of a box that is nearest to a sphere moves along with it.
template <class Index>
PairSums sum_pairs(const Index& index, const PosedSpheres& spheres, const Eigen::Matrix3d& R_FO,
                   const Band& band, Deadline* deadline, BlendExpansion* expansion) {
  if (expansion == nullptr) return blend_pairs(index, spheres, band, deadline);
  SphereSums by_sphere;
  const PairSums sums = blend_pairs(index, spheres, band, deadline, &by_sphere);
  expansion->add(by_sphere, R_FO, std::is_same_v<Index, ThinnedCloud>);
  return sums;
}

RepulsiveWrench scaled(const RepulsiveWrench& wrench, double factor) {
  return {factor * wrench.force, factor * wrench.torque};
}

}  // namespace

RepulsiveWrench RepulsiveWrench::unknown() {
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return {nan, nan};
}

double repulsion_strength(const LinkProximity& proximity, const RepulsionConfig& config) {
  if (proximity.state < LinkState::kNear) return 0.0;
  return std::clamp(1.0 - proximity.distance / config.influence_distance, 0.0, 1.0);
}

RepulsiveWrench nearest_repulsion(const Eigen::Isometry3d& X_FL, const LinkProximity& proximity,
                                  const RepulsionConfig& config) {
  if (proximity.state == LinkState::kUnknown) return RepulsiveWrench::unknown();
  const double strength = repulsion_strength(proximity, config);
  if (!(strength > 0.0)) return {};
  const Eigen::Vector3d arm = proximity.p_FCl - X_FL.translation();
  return scaled({proximity.direction, arm.cross(proximity.direction)}, config.gain * strength);
}

struct Repulsion::Spheres {
  std::vector<std::vector<SphereGroup>> by_link;  // of at most kCoarseSpheres spheres
};

Repulsion::Repulsion(const std::shared_ptr<const RobotModel>& model) {
  const auto spheres = std::make_shared<Spheres>();
  spheres->by_link.reserve(model->links.size());
  for (const LinkModel& link : model->links) {
    spheres->by_link.push_back(group_spheres(coarse_spheres(link.packing, kCoarseSpheres)));
  }
  spheres_ = spheres;
}

RepulsiveWrench Repulsion::wrench(std::size_t link, const Eigen::Isometry3d& X_FL,
                                  SnapshotSpan clouds, const LinkProximity& proximity,
                                  const RepulsionConfig& config, TimePoint end) const {
  return blend(link, X_FL, clouds, proximity, config, end, nullptr);
}

RepulsiveWrench Repulsion::blend(std::size_t link, const Eigen::Isometry3d& X_FL,
                                 SnapshotSpan clouds, const LinkProximity& proximity,
                                 const RepulsionConfig& config, TimePoint end,
                                 BlendExpansion* expansion) const {
  const bool has_link = link < spheres_->by_link.size();
  if (proximity.state == LinkState::kUnknown || !has_link) return RepulsiveWrench::unknown();
  const double strength = repulsion_strength(proximity, config);
  if (!(strength > 0.0)) return {};
  Deadline deadline(end);
  if (deadline.passed()) return RepulsiveWrench::unknown();

  const std::vector<SphereGroup>& groups = spheres_->by_link[link];
  const auto smoothing = static_cast<float>(std::max(config.smoothing, kLeastSmoothing));
  if (expansion != nullptr) expansion->begin(groups, X_FL);
  float nearest = std::numeric_limits<float>::infinity();
  for_each_index(
      clouds, groups, X_FL,
      [&](const auto& index, const PosedSpheres& spheres, const Eigen::Matrix3d& R_FO) {
        nearest = find_nearest(index, spheres, R_FO, {nearest, smoothing}, &deadline, expansion);
      });
  if (deadline.has_passed()) return RepulsiveWrench::unknown();
  const double length = config.gain * strength;
  if (!std::isfinite(nearest)) return nearest_repulsion(X_FL, proximity, config);
  Total total{proximity.direction, {}, 0.0};
  for_each_index(clouds, groups, X_FL,
                 [&](const auto& index, const PosedSpheres& spheres, const Eigen::Matrix3d& R_FO) {
                   total.add(
                       sum_pairs(index, spheres, R_FO, {nearest, smoothing}, &deadline, expansion),
                       R_FO);
                 });
  if (deadline.has_passed()) return RepulsiveWrench::unknown();
  if (expansion != nullptr) expansion->end({total.wrench, total.weight}, nearest);
  return scaled(total.wrench, length / total.weight);
}

}  // namespace ist
