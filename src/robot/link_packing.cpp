#include "internal/robot/link_packing.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <variant>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

// [m^2]
double surface_area(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    const Eigen::Vector3d& s = box->size;
    return 2.0 * (s.x() * s.y() + s.y() * s.z() + s.z() * s.x());
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return 2.0 * kPi * cylinder->radius * (cylinder->radius + cylinder->length);
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    return 4.0 * kPi * sphere->radius * sphere->radius;
  }
  const auto& mesh = std::get<TriangleMesh>(shape);
  double area = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d& a = mesh.corner(t, 0);
    area += 0.5 * (mesh.corner(t, 1) - a).cross(mesh.corner(t, 2) - a).norm();
  }
  return area;
}

// The rank of a sphere in the order of the link: the share of its element that comes before it.
struct Rank {
  double share;
  std::size_t element, sphere;

  bool operator<(const Rank& other) const {
    return share != other.share ? share < other.share : element < other.element;
  }
};

}  // namespace

std::vector<PackingConfig> element_configs(const LinkGeometry& geometry,
                                           const PackingConfig& config) {
  std::vector<double> areas;
  double total_area = 0.0;
  int remaining = config.max_spheres;
  for (const GeometryElement& element : geometry) {
    const bool is_sphere = std::holds_alternative<Sphere>(element.shape);
    areas.push_back(is_sphere ? 0.0 : surface_area(element.shape));
    total_area += areas.back();
    if (is_sphere) --remaining;
  }
  std::vector<PackingConfig> configs(geometry.size(), config);
  if (geometry.size() == 1) return configs;
  for (std::size_t i = 0; i < configs.size(); ++i) {
    const double share = total_area > 0.0 ? areas[i] / total_area : 0.0;
    configs[i].max_spheres = std::max(1, static_cast<int>(std::floor(share * remaining)));
  }
  return configs;
}

std::vector<PackingConfig> link_configs(const LinkGeometry& geometry, std::size_t attached,
                                        const PackingConfig& config) {
  if (attached == 0) return element_configs(geometry, config);
  const LinkGeometry own(geometry.begin(), geometry.end() - static_cast<std::ptrdiff_t>(attached));
  std::vector<PackingConfig> configs = element_configs(own, config);
  configs.resize(geometry.size(), config);
  return configs;
}

Packing combine(const LinkGeometry& geometry, const std::vector<const Packing*>& packings) {
  std::vector<Rank> order;
  Packing link;
  PackingCertificate& all = link.certificate;
  all.reached = true;
  for (std::size_t e = 0; e < packings.size(); ++e) {
    const std::size_t count = packings[e]->spheres.size();
    for (std::size_t i = 0; i < count; ++i) {
      order.push_back({static_cast<double>(i) / static_cast<double>(count), e, i});
    }
    const PackingCertificate& one = packings[e]->certificate;
    all.max_gap = std::max(all.max_gap, one.max_gap);
    all.interior_gap = std::max(all.interior_gap, one.interior_gap);
    all.mean_gap += one.mean_gap * one.surface_area;
    all.unreachable_area += one.unreachable_area;
    all.surface_area += one.surface_area;
    all.reached = all.reached && one.reached;
  }
  if (all.surface_area > 0.0) all.mean_gap /= all.surface_area;

  std::stable_sort(order.begin(), order.end());
  link.spheres.reserve(order.size());
  for (const Rank& rank : order) {
    InnerSphere sphere = packings[rank.element]->spheres[rank.sphere];
    sphere.center = geometry[rank.element].X_LE * sphere.center;
    link.spheres.push_back(sphere);
  }
  return link;
}

double packing_work(const Shape& shape) {
  constexpr double kPrimitive = 300.0;
  if (std::holds_alternative<Sphere>(shape)) return 1.0;
  const auto* mesh = std::get_if<TriangleMesh>(&shape);
  return mesh != nullptr ? 1.0 + static_cast<double>(mesh->triangles.size()) : kPrimitive;
}

}  // namespace ist
