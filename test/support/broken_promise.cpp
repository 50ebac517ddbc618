#include "support/broken_promise.h"

#include <cmath>
#include <sstream>
#include <variant>

namespace ist::test {

std::string broken_promise(const LinkProximity& answer, const SceneTruth& truth,
                           const QueryConfig& config, bool is_complete) {
  std::ostringstream what;
  what.precision(12);
  const auto values = [&](const char* promise) {
    what << promise << ": state " << static_cast<int>(answer.state) << ", distance "
         << answer.distance << ", bound " << answer.lower_bound << ", truth " << truth.measured.low
         << " to " << truth.measured.high << ", stored " << truth.stored.low << " to "
         << truth.stored.high << ", tolerance " << config.tolerance << ", relative "
         << config.relative_tolerance << ", margin " << config.margin << ", range "
         << config.max_distance << (is_complete ? "" : ", stopped");
    return what.str();
  };
  const double side = kSideRounding * truth.scale;
  const bool is_decided =
      std::min({std::abs(truth.measured.high), std::abs(truth.measured.low),
                std::abs(truth.stored.high), std::abs(truth.stored.low)}) > side &&
      (truth.stored.low < 0.0) == (truth.stored.high < 0.0);
  if (answer.state == LinkState::kUnknown) {
    return is_complete ? values("complete, and unknown") : std::string();
  }
  if (!(answer.lower_bound <= answer.distance)) return values("bound above distance");
  if (answer.state == LinkState::kClear) {
    return truth.measured.high > config.max_distance + config.margin - 1e-6 * truth.scale
               ? std::string()
               : values("clear, and there is something");
  }
  const double allowed = is_decided ? 1e-12 * truth.scale : 2.0 * side;
  const double bound = answer.lower_bound + config.margin;
  if (!(bound <= truth.measured.high + allowed)) return values("bound above the truth");
  if (!(answer.distance >= truth.stored.low - side)) return values("distance below the truth");
  if ((answer.state == LinkState::kContact) != (answer.distance < 0.0)) return values("state");
  if (is_decided && answer.state == LinkState::kContact && truth.stored.low > 0.0) {
    return values("contact of a point outside");
  }
  if (!is_complete) return "";
  const double width =
      std::max(config.tolerance, config.relative_tolerance * std::abs(answer.distance));
  if (!(answer.distance <= truth.stored.high + width + side)) return values("distance too large");
  if (is_decided && answer.state != LinkState::kContact && truth.stored.high < 0.0) {
    return values("no contact of a point inside");
  }
  if (truth.is_closed && !(answer.distance - bound <= width + 5e-5 * truth.scale)) {
    return values("interval too wide");
  }
  return "";
}

PairBody::PairBody(const LinkGeometry& link) : geometry(&link), surface(triangles_of(link)) {
  for (const auto& triangle : triangles_of(link)) {
    points.insert(points.end(), triangle.p, triangle.p + 3);
    points.push_back((triangle.p[0] + triangle.p[1] + triangle.p[2]) / 3.0);
  }
  for (const GeometryElement& element : link) add_curved(element);
}

void PairBody::add_curved(const GeometryElement& element) {
  const auto* cylinder = std::get_if<Cylinder>(&element.shape);
  const auto* sphere = std::get_if<Sphere>(&element.shape);
  if (cylinder == nullptr && sphere == nullptr) return;
  has_curves = true;
  for (int i = 0; i < 48; ++i) {
    const double angle = EIGEN_PI / 4.0 * i, height = 0.4 * (i / 8) - 1.0;
    const Eigen::Vector3d lateral(std::cos(angle), std::sin(angle), 0.0);
    const Eigen::Vector3d up = height * Eigen::Vector3d::UnitZ();
    points.push_back(
        element.X_LE *
        (cylinder != nullptr
             ? Eigen::Vector3d(cylinder->radius * lateral + 0.5 * cylinder->length * up)
             : Eigen::Vector3d(sphere->radius * (lateral + up).normalized())));
  }
}

PairTruth pair_truth(const PairBody& a, const PairBody& b, const Eigen::Isometry3d& X_AB,
                     bool are_closed) {
  PairTruth truth;
  truth.surface = a.surface.distance(b.surface, X_AB);
  const Eigen::Isometry3d X_BA = X_AB.inverse();
  for (const Eigen::Vector3d& p : a.points)
    truth.deepest.add(truth_interval(*b.geometry, X_BA * p));
  for (const Eigen::Vector3d& p : b.points)
    truth.deepest.add(truth_interval(*a.geometry, X_AB * p));
  truth.is_exact = are_closed && !a.has_curves && !b.has_curves;
  return truth;
}

std::string broken_promise(const PairProximity& answer, const PairTruth& truth,
                           const QueryConfig& config, bool is_complete) {
  std::ostringstream what;
  what.precision(12);
  const auto values = [&](const char* promise) {
    what << promise << ": state " << static_cast<int>(answer.state) << ", distance "
         << answer.distance << ", bound " << answer.lower_bound << ", surfaces " << truth.surface
         << ", deepest point " << truth.deepest.low << " to " << truth.deepest.high
         << ", tolerance " << config.tolerance << ", relative " << config.relative_tolerance
         << ", margin " << config.margin << ", range " << config.max_distance
         << (is_complete ? "" : ", stopped");
    return what.str();
  };
  if (answer.state == LinkState::kUnknown) return "";
  const double side = kSideRounding * truth.scale;
  if (!(answer.lower_bound <= answer.distance)) return values("bound above distance");
  const bool is_clear = answer.state == LinkState::kClear;
  const double bound = answer.lower_bound + (is_clear ? 0.0 : config.margin);
  const double allowed =
      std::abs(truth.deepest.high) > side && truth.surface > side ? 1e-12 * truth.scale : side;
  if (!(bound <= truth.highest() + allowed)) return values("bound above the truth");
  if (is_clear || !truth.is_exact) return "";
  if (truth.surface > side && truth.deepest.low > side) {  // apart
    if (!(answer.distance >= truth.surface - side)) return values("distance below the truth");
    if (!is_complete) return "";
    const double width = std::max(config.tolerance, config.relative_tolerance * answer.distance);
    if (!(answer.distance <= truth.surface + width + 1e-5 * truth.scale)) {
      return values("distance too large");
    }
    // Where surfaces nearly touch, the side may stay undecided.
    if (truth.surface > 1e-6 && !(answer.distance - bound <= width + 1e-5 * truth.scale)) {
      return values("interval too wide");
    }
  } else if (is_complete && truth.deepest.high < -side && !(answer.distance <= 0.0)) {
    return values("a point is inside");
  }
  return "";
}

}  // namespace ist::test
