#include "internal/packing/packer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hole_obstacles.h"
#include "interior_cover.h"
#include "internal/geometry/cancelled.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/mesh_surface.h"
#include "internal/geometry/tessellation.h"
#include "ist_proximity/geometry/error.h"
#include "medial_sphere.h"
#include "packed_mesh.h"
#include "packing_watch.h"
#include "surface_cover.h"
#include "volume_filler.h"

namespace ist {
namespace {

// The share of max_error that the deviation of an inscribed prism may use.
constexpr double kTessellationShare = 0.1;

// In disjoint packings, spaces are filled down to spheres of this share of max_error.
constexpr double kMinFillRadius = 0.5;

// Tolerance of the obstacles that keep inner spheres away from holes: a share of max_error, and at
// least a share of the mesh's size.
constexpr double kHoleTolerance = 0.1;
constexpr double kMinHoleTolerance = 1e-3;

// About the share of the time that the surface takes; the interior takes the rest.
constexpr double kSurfaceShare = 0.6;

void check(const Shape& shape) {
  const std::string fault = shape_fault(shape);
  if (!fault.empty()) throw ModelError(fault);
}

Packing pack_inscribed(const PackedMesh& inscribed, const PackingConfig& config,
                       const PackingProgress& progress) {
  PackingConfig inner = config;
  inner.max_error = config.max_error - inscribed.deviation;
  Packing packing = pack_mesh(inscribed.mesh, inner, progress);
  for (InnerSphere& sphere : packing.spheres) sphere.cover_radius += inscribed.deviation;
  PackingCertificate& certificate = packing.certificate;
  certificate.max_gap += inscribed.deviation;
  certificate.mean_gap += inscribed.deviation;
  certificate.interior_gap += inscribed.deviation;
  certificate.reached = certificate.max_gap <= config.max_error;
  return packing;
}

Packing pack_sphere(const Sphere& sphere) {
  Packing packing;
  packing.spheres.push_back({Eigen::Vector3d::Zero(), sphere.radius, sphere.radius});
  packing.certificate.surface_area = 4.0 * M_PI * sphere.radius * sphere.radius;
  packing.certificate.reached = true;
  return packing;
}

// The coarsest packing: a point of the surface whose cover sphere holds the mesh. It stands where
// packing was stopped before it had a better one.
Packing single_cover_sphere(const TriangleMesh& mesh) {
  const Eigen::Vector3d& center = mesh.corner(0, 0);
  double radius = 0.0, area = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d &a = mesh.corner(t, 0), &b = mesh.corner(t, 1), &c = mesh.corner(t, 2);
    for (const Eigen::Vector3d& corner : {a, b, c}) {
      radius = std::max(radius, (corner - center).norm());
    }
    area += 0.5 * (b - a).cross(c - a).norm();
  }
  radius *= 1.0 + 1e-12;  // rounding
  Packing packing;
  packing.spheres.push_back({center, 0.0, radius});
  packing.certificate = {radius, radius, radius, area, area, false};
  return packing;
}

Packing pack_watched(const TriangleMesh& mesh, const MeshSurface& surface,
                     const PackingConfig& config, PackingWatch* watch) {
  const TriangleBvh& bvh = surface.bvh;
  const double size = bvh.bounds().sizes().norm();
  HoleObstacles holes(mesh, surface,
                      std::max(kHoleTolerance * config.max_error, kMinHoleTolerance * size), watch);
  SphereSearch spheres;
  const bool may_overlap = config.order == PackingOrder::kMedial;
  const MedialSphereFinder finder(bvh, &holes, may_overlap ? nullptr : &spheres);
  std::optional<VolumeFiller> filler;
  if (!may_overlap) filler.emplace(bvh, finder, spheres, kMinFillRadius * config.max_error);
  SurfaceCover cover(mesh, finder, &spheres, watch);
  watch->begin_part(0.0, kSurfaceShare);
  if (watch->stopped() || !cover.refine(config, filler ? &*filler : nullptr)) throw Cancelled();
  cover.tighten_certificate(config);
  Packing packing;
  cover.certify(&packing);
  watch->begin_part(kSurfaceShare, 1.0);
  if (watch->stopped() || !cover_interior(bvh, finder, config, watch, &spheres, &packing)) {
    packing.certificate.interior_gap = size;
  }
  packing.certificate.reached = packing.certificate.max_gap <= config.max_error;
  watch->report(1.0);
  return packing;
}

}  // namespace

Packing pack_mesh(const TriangleMesh& mesh, const PackingConfig& config,
                  const PackingProgress& progress, const MeshSurface* surface) {
  if (mesh.triangles.empty()) throw ModelError("cannot pack a mesh without triangles");
  check(mesh);
  PackingWatch watch(progress);
  try {
    if (surface != nullptr) return pack_watched(mesh, *surface, config, &watch);
    const auto stopped = [&] { return !watch.keeps_on(); };
    const TriangleBvh bvh(mesh, stopped);
    const std::vector<OpenEdge> open = open_edges(mesh, stopped);
    return pack_watched(mesh, {bvh, open}, config, &watch);
  } catch (const Cancelled&) {
    return single_cover_sphere(mesh);
  }
}

Packing pack_element(const Shape& shape, const PackingConfig& config,
                     const PackingProgress& progress, const MeshSurface* surface) {
  if (!std::holds_alternative<TriangleMesh>(shape)) check(shape);
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return pack_sphere(*sphere);
  if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) {
    return pack_mesh(*mesh, config, progress, surface);
  }
  return pack_inscribed(packed_mesh(shape, config), config, progress);
}

PackedMesh packed_mesh(const Shape& shape, const PackingConfig& config) {
  if (std::holds_alternative<Sphere>(shape)) return {};
  if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) return {*mesh, 0.0};
  const auto* box = std::get_if<Box>(&shape);
  Tessellation tessellation =
      box != nullptr ? tessellate(*box)
                     : tessellate(std::get<Cylinder>(shape), kTessellationShare * config.max_error);
  return {std::move(tessellation.mesh), tessellation.deviation};
}

}  // namespace ist
