#include "ist_proximity/repulsion/self_repulsion.h"

#include <algorithm>
#include <limits>

namespace ist {
namespace {

bool is_of(const LinkPair& pair, std::size_t link) {
  return pair.first == link || pair.second == link;
}

}  // namespace

RepulsiveWrench self_repulsion(std::size_t link, const Eigen::Isometry3d& X_FL,
                               Span<const LinkPair> pairs, Span<const PairProximity> answers,
                               const RepulsionConfig& config) {
  if (pairs.size() != answers.size()) return RepulsiveWrench::unknown();
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!is_of(pairs[i], link)) continue;
    if (answers[i].state == LinkState::kUnknown) return RepulsiveWrench::unknown();
    least = std::min(least, answers[i].distance);
  }
  RepulsiveWrench sum;
  if (!(least < config.influence_distance)) return sum;
  const double smoothing = std::max(config.smoothing, kLeastSmoothing);
  double weights = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const PairProximity& answer = answers[i];
    if (!is_of(pairs[i], link) || answer.state < LinkState::kNear) continue;
    const double falling = std::max(0.0, 1.0 - (answer.distance - least) / smoothing);
    const bool is_first = pairs[i].first == link;
    const Eigen::Vector3d push = falling * falling * (is_first ? 1.0 : -1.0) * answer.direction;
    const Eigen::Vector3d at = (is_first ? answer.p_FCa : answer.p_FCb) - X_FL.translation();
    sum.force += push;
    sum.torque += at.cross(push);
    weights += falling * falling;
  }
  const double strength = std::clamp(1.0 - least / config.influence_distance, 0.0, 1.0);
  const double scale = config.gain * strength / weights;  // the nearest pair has weight 1
  sum.force *= scale;
  sum.torque *= scale;
  return sum;
}

}  // namespace ist
