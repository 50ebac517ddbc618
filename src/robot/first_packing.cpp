#include "first_packing.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <variant>

namespace ist {
namespace {

// The gap of the first packing, as a share of the diagonal of the shape's box. A link of a robot
// needs 15 to 60 spheres for it.
constexpr double kFirstGap = 0.06;
// More spheres are not in it, whatever the shape.
constexpr int kFirstSpheres = 48;

double diagonal(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) return box->size.norm();
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return Eigen::Vector3d(2.0 * cylinder->radius, 2.0 * cylinder->radius, cylinder->length).norm();
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return 2.0 * sphere->radius;
  const auto& mesh = std::get<TriangleMesh>(shape);
  Eigen::AlignedBox3d box;
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) box.extend(mesh.vertices[vertex]);
  }
  return box.isEmpty() ? 0.0 : box.sizes().norm();
}

}  // namespace

PackingConfig first_packing(const Shape& shape, const PackingConfig& final) {
  PackingConfig first = final;
  first.max_error = std::max(final.max_error, kFirstGap * diagonal(shape));
  first.max_spheres = std::min(final.max_spheres, kFirstSpheres);
  return first;
}

bool is_final(const Packing& packing, const PackingConfig& made, const PackingConfig& final) {
  if (made.max_error != final.max_error) return false;
  // A lower limit of spheres may have played no part.
  const bool is_limited = packing.spheres.size() >= static_cast<std::size_t>(made.max_spheres);
  return made.max_spheres == final.max_spheres || (!is_limited && packing.certificate.reached);
}

}  // namespace ist
