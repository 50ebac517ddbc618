#include "internal/geometry/outside_margin.h"

#include <algorithm>
#include <cmath>

#include "geometry/open_edge_hierarchy.h"
#include "geometry/solid_element.h"

namespace ist {
namespace {

// Places are outside below this winding number, and inside above 1 less it, in spite of the errors
// of winding numbers, which are 0.01 about, and larger for the quick one.
constexpr double kSurelyOutside = 0.47;

// The margin of one element, about p_E [m] in its frame. A way that does not cross the surface
// stays on one side of a closed element.
SideMargin measure(const SolidElement& element, const Eigen::Vector3d& p_E, double largest,
                   bool also_inside) {
  if (element.is_closed) {
    const bool is_inside = element.is_inside(p_E);
    return {is_inside, is_inside && !also_inside ? 0.0 : largest};
  }
  const Eigen::AlignedBox3d& box = element.bvh.bounds();
  double error;
  const double quick = element.bvh.quick_winding_number(p_E, &error);
  SideMargin result;
  result.is_inside =
      std::abs(quick - 0.5) > error ? box.contains(p_E) && quick > 0.5 : element.is_inside(p_E);
  double slack = kSurelyOutside - (quick + error), radius = largest;
  if (result.is_inside) {
    // The inside ends at the box about the mesh, too.
    const double to_box = std::min((p_E - box.min()).minCoeff(), (box.max() - p_E).minCoeff());
    radius = also_inside ? std::min(radius, to_box) : 0.0;
    slack = quick - error - (1.0 - kSurelyOutside);
  }
  if (!(slack > 0.0) || !(radius > 0.0)) return result;
  result.margin = element.open_edges.steady_radius(p_E, slack, (1.0 - 1e-9) * radius);
  return result;
}

// A place is inside where it is inside one element.
SideMargin measure(const Solid& solid, const Eigen::Vector3d& p_L, double largest,
                   bool also_inside) {
  SideMargin outside{false, largest};
  for (const SolidElement& element : elements_of(solid)) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    if (element.is_mesh() && element.bvh.bounds().exteriorDistance(p_E) > largest) continue;
    const SideMargin found = measure(element, p_E, largest, also_inside);
    if (found.is_inside) return found;
    outside.margin = std::min(outside.margin, found.margin);
  }
  return outside;
}

}  // namespace

SideMargin side_margin(const Solid& solid, const Eigen::Vector3d& p_L, double largest) {
  return measure(solid, p_L, largest, true);
}

SideMargin outside_margin(const Solid& solid, const Eigen::Vector3d& p_L, double largest) {
  return measure(solid, p_L, largest, false);
}

}  // namespace ist
