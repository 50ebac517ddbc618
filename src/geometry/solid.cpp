#include "ist_proximity/geometry/solid.h"

#include <algorithm>
#include <utility>

#include "geometry/primitive_distance.h"
#include "geometry/solid_element.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/numbers.h"
#include "internal/geometry/solid_queries.h"
#include "ist_proximity/geometry/error.h"

namespace ist {

Solid::Solid(const LinkGeometry& geometry) : Solid(make_solid(geometry, {})) {}

Solid make_solid(const LinkGeometry& geometry, const std::function<bool()>& cancelled) {
  std::vector<SolidElement> elements;
  elements.reserve(geometry.size());
  for (const GeometryElement& source : geometry) {
    const std::string fault = element_fault(source);
    if (!fault.empty()) throw ModelError(source.source + ": " + fault);
    elements.emplace_back(source, cancelled);
  }
  Solid solid;
  solid.elements_ = std::make_shared<const std::vector<SolidElement>>(std::move(elements));
  return solid;
}

SignedDistance Solid::signed_distance(const Eigen::Vector3d& p_L) const {
  SignedDistance best;
  for (const SolidElement& element : elements_of(*this)) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    SignedDistance candidate;
    if (element.is_mesh()) {
      // An element that p is outside of matters only if it is nearer than all others so far.
      const bool inside = element.is_inside(p_E);
      const double limit = inside ? kInfinity : std::max(best.distance, 0.0);
      candidate = element.signed_distance(p_E, element.bvh.closest(p_E, limit * limit), inside);
    } else {
      candidate = primitive_distance(element.primitive, p_E);
    }
    if (candidate.distance < best.distance) best = to_link_frame(element, candidate);
  }
  return best;
}

bool Solid::is_inside(const Eigen::Vector3d& p_L) const {
  const std::vector<SolidElement>& elements = elements_of(*this);
  return std::any_of(elements.begin(), elements.end(), [&](const SolidElement& element) {
    return element.is_inside(element.X_EL * p_L);
  });
}

bool Solid::is_closed() const {
  const std::vector<SolidElement>& elements = elements_of(*this);
  return std::all_of(elements.begin(), elements.end(),
                     [](const SolidElement& element) { return element.is_closed; });
}

bool Solid::empty() const { return elements_of(*this).empty(); }

std::size_t Solid::triangle_count() const {
  std::size_t count = 0;
  for (const SolidElement& element : elements_of(*this)) count += element.bvh.size();
  return count;
}

}  // namespace ist
