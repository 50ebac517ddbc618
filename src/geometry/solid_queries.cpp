#include "internal/geometry/solid_queries.h"

#include <algorithm>
#include <cmath>

#include "geometry/primitive_distance.h"
#include "geometry/solid_element.h"

namespace ist {

SignedDistance distance_outside(const Solid& solid, const Eigen::Vector3d& p_L, double max_distance,
                                const Eigen::Vector3d& outward_hint_L, double tolerance,
                                double* lower_bound) {
  SignedDistance best;
  if (lower_bound != nullptr) *lower_bound = std::max(max_distance, 0.0);
  if (!(max_distance > 0.0)) return best;
  double upper_bound = max_distance;
  for (const SolidElement& element : elements_of(solid)) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    SignedDistance candidate;
    double element_bound;
    if (element.is_mesh()) {
      const ClosestPoint closest = element.bvh.closest(
          p_E, upper_bound * upper_bound, element.X_EL.linear() * outward_hint_L, 0.0, tolerance);
      candidate = element.signed_distance(p_E, closest, false);
      element_bound = closest.lower_bound;
    } else {
      candidate = primitive_distance(element.primitive, p_E);
      element_bound = candidate.distance;
    }
    if (lower_bound != nullptr) *lower_bound = std::min(*lower_bound, element_bound);
    if (candidate.distance < upper_bound) {
      upper_bound = candidate.distance;
      best = to_link_frame(element, candidate);
    }
  }
  return best;
}

bool is_within_distance(const Solid& solid, const Eigen::Vector3d& p_L, double distance) {
  // Squares and roots are rounded: more is searched, and the search ends early at less.
  constexpr double kRounding = 1e-9, kLeast = 1e-9;  // a share, [m]
  const double limit = distance * (1.0 + kRounding) + kLeast, sure = distance * (1.0 - kRounding);
  for (const SolidElement& element : elements_of(solid)) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    if (!element.is_mesh()) {
      if (primitive_distance(element.primitive, p_E).distance <= distance) return true;
      continue;
    }
    const ClosestPoint closest =
        element.bvh.closest(p_E, limit * limit, Eigen::Vector3d::Zero(), sure * sure);
    if (std::sqrt(closest.distance_sq) <= distance) return true;
  }
  return false;
}

double support(const Solid& solid, const Eigen::Vector3d& n_L, double tolerance, double at_least) {
  double largest = at_least;
  for (const SolidElement& element : elements_of(solid)) {
    const Eigen::Vector3d n_E = element.X_EL.linear() * n_L;
    const double offset = n_L.dot(element.X_LE.translation());
    const double in_E = element.is_mesh() ? element.bvh.support(n_E, tolerance, largest - offset)
                                          : primitive_support(element.primitive, n_E);
    largest = std::max(largest, in_E + offset);
  }
  return largest;
}

BoxDistance distance_to_box(const Solid& solid, const Eigen::AlignedBox3d& box_O,
                            const Eigen::Isometry3d& X_OL, double max_distance,
                            const std::optional<Eigen::Vector3d>& near_O) {
  BoxDistance best;
  double limit = max_distance, lower_bound = max_distance;
  for (const SolidElement& element : elements_of(solid)) {
    const Eigen::Isometry3d X_OE = X_OL * element.X_LE;
    BoxDistance candidate;
    if (element.is_mesh()) {
      candidate = element.bvh.closest_to_box(box_O, X_OE, limit, near_O);
    } else if (const auto* sphere = std::get_if<Sphere>(&element.primitive)) {
      candidate = sphere_to_box(*sphere, X_OE.translation(), box_O);
    } else if (const auto* cylinder = std::get_if<Cylinder>(&element.primitive)) {
      candidate = cylinder_to_box(*cylinder, X_OE, box_O, limit);
    } else {
      candidate = element.box_sides.closest_to_box(box_O, X_OE, limit, near_O);
    }
    lower_bound = std::min(lower_bound, candidate.lower_bound);
    if (candidate.distance >= limit) continue;
    best = candidate;
    limit = candidate.distance;
  }
  best.lower_bound = lower_bound;
  return best;
}

std::size_t memory_of(const Solid& solid) {
  std::size_t bytes = 0;
  for (const SolidElement& element : elements_of(solid)) {
    bytes += sizeof element + element.bvh.memory() + element.box_sides.memory() +
             element.normals.capacity() * sizeof(Eigen::Vector3d) +
             element.boundary.capacity() * sizeof(OpenEdge);
  }
  return bytes;
}

bool is_one_mesh(const Solid& solid) {
  const std::vector<SolidElement>& elements = elements_of(solid);
  return elements.size() == 1 && elements[0].is_mesh();
}

std::optional<MeshSurface> surface_of(const Solid& solid, std::size_t element) {
  const std::vector<SolidElement>& elements = elements_of(solid);
  if (element >= elements.size() || !elements[element].is_mesh()) return std::nullopt;
  return MeshSurface{elements[element].bvh, elements[element].boundary};
}

bool is_same_solid(const Solid& one, const Solid& other) {
  return !one.empty() && &elements_of(one) == &elements_of(other);
}

}  // namespace ist
