#include "packing_stages.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <variant>

namespace ist {
namespace {

// The gap of the first stage, as a share of the diagonal of the shape's box. A link of a robot
// needs 15 to 60 spheres for it.
constexpr double kFirstGap = 0.06;
// More spheres are not in the first stage, whatever the shape.
constexpr int kFirstSpheres = 48;
// The gap of a stage, as a share of the gap of the one before.
constexpr double kGapShare = 0.25;
// A stage whose gap were less than this factor above the wanted one is left out.
constexpr double kNearlyFinal = 1.6;

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

PackingConfig first_stage(const Shape& shape, const PackingConfig& final) {
  PackingConfig stage = final;
  stage.max_error = std::max(final.max_error, kFirstGap * diagonal(shape));
  stage.max_spheres = std::min(final.max_spheres, kFirstSpheres);
  return stage;
}

PackingConfig next_stage(const Packing& packing, const PackingConfig& final) {
  PackingConfig stage = final;
  const double gap = kGapShare * packing.certificate.max_gap;
  if (gap > kNearlyFinal * final.max_error) stage.max_error = gap;
  return stage;
}

bool is_final_stage(const Packing& packing, const PackingConfig& stage,
                    const PackingConfig& final) {
  if (stage.max_error != final.max_error) return false;
  // The limit of spheres of an earlier stage played no part.
  const bool is_limited = packing.spheres.size() >= static_cast<std::size_t>(stage.max_spheres);
  return stage.max_spheres == final.max_spheres || (!is_limited && packing.certificate.reached);
}

}  // namespace ist
