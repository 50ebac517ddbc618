#include "internal/geometry/outside_margin.h"

#include <algorithm>
#include <cmath>

#include "geometry/open_edge_hierarchy.h"
#include "geometry/solid_element.h"

namespace ist {
namespace {

// [m] Larger margins are not looked for: the gradient's bound grows with them.
constexpr double kLargestMargin = 0.05;
// A place below this winding number is outside in spite of the errors of winding numbers, which are
// 0.01, and 0.06 for the quick one.
constexpr double kSurelyOutside = 0.47;

}  // namespace

OutsideMargin outside_margin(const Solid& solid, const Eigen::Vector3d& p_L, double largest) {
  const SolidElement& element = elements_of(solid).front();
  const Eigen::Vector3d p_E = element.X_EL * p_L;
  const double quick = element.bvh.quick_winding_number(p_E);
  OutsideMargin result;
  if (std::abs(quick - 0.5) > TriangleBvh::kQuickWindingError) {
    result.is_inside = element.bvh.bounds().contains(p_E) && quick > 0.5;
  } else {
    result.is_inside = element.is_inside(p_E);
  }
  const double slack = kSurelyOutside - (quick + TriangleBvh::kQuickWindingError);
  if (result.is_inside || !(slack > 0.0) || !(largest > 0.0)) return result;
  const double radius = std::min((1.0 - 1e-9) * largest, kLargestMargin);
  result.margin = element.open_edges.steady_radius(p_E, slack, radius);
  return result;
}

}  // namespace ist
