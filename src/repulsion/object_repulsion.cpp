#include "ist_proximity/repulsion/object_repulsion.h"

#include <algorithm>

namespace ist {
namespace {

constexpr double kLeastSmoothing = 0.001;  // [m] as of the blend over points

double weight(double distance, double nearest, const RepulsionConfig& config) {
  const double smoothing = std::max(config.smoothing, kLeastSmoothing);
  const double w = std::max(0.0, 1.0 - (distance - nearest) / smoothing);
  return w * w;
}

}  // namespace

RepulsiveWrench with_objects(const Eigen::Isometry3d& X_FL, const RepulsiveWrench& of_clouds,
                             const LinkProximity& clouds, Span<const NearObject> objects,
                             const LinkProximity& both, const RepulsionConfig& config) {
  if (both.state == LinkState::kUnknown) return RepulsiveWrench::unknown();
  const double strength = repulsion_strength(both, config);
  if (!(strength > 0.0)) return {};
  RepulsiveWrench sum;
  double total = 0.0;
  const double of_cloud = repulsion_strength(clouds, config);
  if (of_cloud > 0.0) {
    const double w = weight(clouds.distance, both.distance, config);
    sum.force += w * of_clouds.force;
    sum.torque += w * of_clouds.torque;
    total += w * of_cloud;
  }
  for (const NearObject& object : objects) {
    const RepulsiveWrench one = nearest_repulsion(X_FL, object.answer, config);
    const double w = weight(object.answer.distance, both.distance, config);
    sum.force += w * one.force;
    sum.torque += w * one.torque;
    total += w * repulsion_strength(object.answer, config);
  }
  if (!(total > 0.0)) return nearest_repulsion(X_FL, both, config);  // the time was over
  sum.force *= strength / total;
  sum.torque *= strength / total;
  return sum;
}

}  // namespace ist
