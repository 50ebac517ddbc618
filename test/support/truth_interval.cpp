#include "support/truth_interval.h"

#include <algorithm>
#include <variant>

#include "support/meshes.h"
#include "support/oracle.h"
#include "support/shape_oracle.h"

namespace ist::test {

void TruthInterval::add(const TruthInterval& other) {
  low = std::min(low, other.low);
  high = std::min(high, other.high);
}

TruthInterval truth_interval(const LinkGeometry& link, const Eigen::Vector3d& p_L) {
  constexpr double kWindingError = 0.02;
  TruthInterval truth;
  for (const GeometryElement& element : link) {
    const Eigen::Vector3d p = element.X_LE.inverse() * p_L;
    if (const auto* mesh = std::get_if<TriangleMesh>(&element.shape)) {
      const double distance = oracle_distance(*mesh, p);
      // Outside the mesh's bounding box is outside (Solid).
      const double winding = bounds(*mesh).contains(p) ? oracle_winding(*mesh, p) : 0.0;
      truth.add({winding > 0.5 - kWindingError ? -distance : distance,
                 winding > 0.5 + kWindingError ? -distance : distance});
    } else {
      const double distance = std::visit(
          [&](const auto& shape) { return oracle_signed_distance(shape, p); }, element.shape);
      truth.add({distance, distance});
    }
  }
  return truth;
}

TruthInterval truth_interval(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
                             const std::vector<Eigen::Vector3d>& points_F) {
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  TruthInterval truth;
  for (const Eigen::Vector3d& p_F : points_F) truth.add(truth_interval(link, X_LF * p_F));
  return truth;
}

}  // namespace ist::test
