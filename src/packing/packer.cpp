#include "internal/packing/packer.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "hole_obstacles.h"
#include "interior_cover.h"
#include "internal/geometry/tessellation.h"
#include "ist_proximity/geometry/error.h"
#include "medial_sphere.h"
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

// Progress of a step that goes from `from` to `to` of the whole.
PackingProgress share_of(const PackingProgress& progress, double from, double to) {
  if (!progress) return {};
  return [progress, from, to](double done) { return progress(from + (to - from) * done); };
}

void check_mesh(const TriangleMesh& mesh) {
  if (mesh.triangles.empty()) throw ModelError("cannot pack a mesh without triangles");
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t v : mesh.triangles[t]) {
      if (v >= mesh.vertices.size()) {
        throw ModelError("triangle " + std::to_string(t) + " names vertex " + std::to_string(v) +
                         " of " + std::to_string(mesh.vertices.size()));
      }
      if (!mesh.vertices[v].allFinite()) {
        throw ModelError("a corner of triangle " + std::to_string(t) + " is not finite");
      }
    }
  }
}

Packing pack_tessellated(const Tessellation& tessellation, const PackingConfig& config,
                         const PackingProgress& progress) {
  PackingConfig inner = config;
  inner.max_error = config.max_error - tessellation.deviation;
  Packing packing = pack_mesh(tessellation.mesh, inner, progress);
  for (InnerSphere& sphere : packing.spheres) sphere.cover_radius += tessellation.deviation;
  PackingCertificate& certificate = packing.certificate;
  certificate.max_gap += tessellation.deviation;
  certificate.mean_gap += tessellation.deviation;
  certificate.interior_gap += tessellation.deviation;
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

}  // namespace

Packing pack_mesh(const TriangleMesh& mesh, const PackingConfig& config,
                  const PackingProgress& progress) {
  check_mesh(mesh);
  bool stopped = false;
  const PackingProgress watched = [&](double done) {
    stopped = stopped || (progress && !progress(done));
    return !stopped;
  };
  const TriangleBvh bvh(mesh);
  const double size = bvh.bounds().sizes().norm();
  HoleObstacles holes(mesh, bvh,
                      std::max(kHoleTolerance * config.max_error, kMinHoleTolerance * size));
  SphereSearch spheres;
  const bool may_overlap = config.order == PackingOrder::kMedial;
  const MedialSphereFinder finder(bvh, &holes, may_overlap ? nullptr : &spheres);
  std::optional<VolumeFiller> filler;
  if (!may_overlap) {
    filler.emplace(bvh, finder, spheres, kMinFillRadius * config.max_error);
    filler->stop_with(watched);
  }
  SurfaceCover cover(mesh, finder, &spheres);
  cover.refine(config, filler ? &*filler : nullptr, share_of(watched, 0.0, kSurfaceShare));
  if (!stopped) cover.tighten_certificate();
  Packing packing;
  cover.certify(&packing);
  const PackingProgress rest = share_of(watched, kSurfaceShare, 1.0);
  if (stopped || !cover_interior(bvh, finder, config, rest, &spheres, &packing)) {
    packing.certificate.interior_gap = size;
  }
  packing.certificate.reached = packing.certificate.max_gap <= config.max_error;
  watched(1.0);
  return packing;
}

Packing pack_element(const Shape& shape, const PackingConfig& config,
                     const PackingProgress& progress) {
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return pack_sphere(*sphere);
  if (const auto* box = std::get_if<Box>(&shape)) {
    return pack_tessellated(tessellate(*box), config, progress);
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return pack_tessellated(tessellate(*cylinder, kTessellationShare * config.max_error), config,
                            progress);
  }
  return pack_mesh(std::get<TriangleMesh>(shape), config, progress);
}

}  // namespace ist
