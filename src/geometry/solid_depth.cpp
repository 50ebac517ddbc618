// Penetration depth: signed distances of points that may be inside a solid, and bounds of it.

#include <algorithm>
#include <cmath>

#include "geometry/primitive_distance.h"
#include "geometry/solid_element.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// A surface that is known to be within a distance must not be missed through rounding.
double rounded_up(double distance) { return (1.0 + 1e-9) * distance + kTouchDistance; }

}  // namespace

// The inside test comes last, because few points get that far.
PointDepth point_depth(const Solid& solid, const Eigen::Vector3d& p_L, double min_depth,
                       const NearSurface& known) {
  const std::vector<SolidElement>& elements = elements_of(solid);
  const double min_depth_sq = min_depth > 0.0 ? min_depth * min_depth : -1.0;
  const bool is_one = elements.size() == 1;
  const double within = is_one ? rounded_up(known.within) : kInfinity;
  PointDepth result;
  bool is_complete = true;
  for (const SolidElement& element : elements) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    SignedDistance candidate;
    if (!element.is_mesh()) {
      candidate = primitive_distance(element.primitive, p_E);
      result.floor = std::min(result.floor, candidate.distance);
    } else {
      const ClosestPoint closest =
          element.bvh.closest(p_E, within * within, Eigen::Vector3d::Zero(), min_depth_sq);
      const double distance = std::sqrt(closest.distance_sq);
      if (closest.distance_sq <= min_depth_sq) {
        is_complete = false;
        result.floor = std::min(result.floor, -distance);
        continue;
      }
      const bool inside = is_one && known.side != NearSurface::Side::kUnknown
                              ? known.side == NearSurface::Side::kInside
                              : element.is_inside(p_E);
      candidate = element.signed_distance(p_E, closest, inside);
      result.floor = std::min(result.floor, element.is_closed && !inside ? distance : -distance);
    }
    if (candidate.distance < result.exact.distance) {
      result.exact = to_link_frame(element, candidate);
    }
  }
  // If nothing is deeper than `min_depth`, an element whose search ended early may be the deepest.
  if (!is_complete && result.exact.distance >= -min_depth) result.exact = SignedDistance();
  return result;
}

double distance_floor(const Solid& solid, const Eigen::Vector3d& p_L,
                      const SignedDistance& measured) {
  const std::vector<SolidElement>& elements = elements_of(solid);
  double floor = measured.distance;
  for (const SolidElement& element : elements) {
    if (element.is_closed || !element.is_mesh()) continue;
    const double unsigned_distance =
        elements.size() == 1 ? std::abs(measured.distance)
                             : std::sqrt(element.bvh.closest(element.X_EL * p_L).distance_sq);
    floor = std::min(floor, -unsigned_distance);
  }
  return floor;
}

}  // namespace ist
