#include "ist_proximity/repulsion/object_repulsion.h"

#include <algorithm>

namespace ist {
namespace {

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
  const double w_cloud = weight(clouds.distance, both.distance, config);
  if (of_cloud > 0.0 && w_cloud > 0.0) {  // else a blend that is late does no harm
    sum.force += w_cloud * of_clouds.force;
    sum.torque += w_cloud * of_clouds.torque;
    total += w_cloud * of_cloud;
  }
  for (const NearObject& object : objects) {
    const RepulsiveWrench one = nearest_repulsion(X_FL, object.answer, config);
    const double w = weight(object.answer.distance, both.distance, config);
    sum.force += w * one.force;
    sum.torque += w * one.torque;
    total += w * repulsion_strength(object.answer, config);
  }
  if (!(total > 0.0)) return RepulsiveWrench::unknown();  // the time was over
  sum.force *= strength / total;
  sum.torque *= strength / total;
  return sum;
}

}  // namespace ist
