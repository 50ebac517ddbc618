#include "internal/packing/packing_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <sstream>
#include <vector>

#include "hole_obstacles.h"
#include "interior_cover.h"
#include "internal/geometry/limits.h"
#include "internal/geometry/tessellation.h"
#include "internal/geometry/triangle_bvh.h"
#include "medial_sphere.h"
#include "packed_mesh.h"
#include "packing_watch.h"
#include "sphere_search.h"
#include "surface_cover.h"

namespace ist {
namespace {

// The change by rounding that is allowed, as a share of the mesh's size and place. Packer and check
// compute the same numbers in the same way, so that next to nothing is needed.
constexpr double kRounding = 1e-12;

std::string millimetres(double metres) {
  std::ostringstream text;
  text << 1e3 * metres << " mm";
  return text.str();
}

std::string sphere_name(std::size_t i) { return "its sphere " + std::to_string(i); }

class PackingCheck {
 public:
  PackingCheck(const PackedMesh& packed, const PackingConfig& config, const Packing& packing,
               PackingWatch* watch)
      : mesh_(packed.mesh),
        deviation_(packed.deviation),
        config_(config),
        packing_(packing),
        watch_(*watch),
        bvh_(packed.mesh, [watch] { return !watch->keeps_on(); }) {
    const Eigen::AlignedBox3d& box = bvh_.bounds();
    tolerance_ = kRounding * (box.sizes().norm() + box.min().cwiseAbs().maxCoeff() +
                              box.max().cwiseAbs().maxCoeff());
  }

  std::string run() {
    std::string fault = count_fault();
    if (fault.empty()) fault = inner_fault();
    if (fault.empty()) fault = surface_fault();
    if (fault.empty()) fault = certificate_fault();
    if (fault.empty()) fault = interior_fault();
    return fault;
  }

 private:
  std::string count_fault() const {
    const std::size_t count = packing_.spheres.size();
    if (count > 0 && count <= static_cast<std::size_t>(config_.max_spheres)) return "";
    return "it holds " + std::to_string(count) + " spheres; packing/max_spheres is " +
           std::to_string(config_.max_spheres);
  }

  // Inner spheres are inside and, where they must be, apart.
  std::string inner_fault() {
    const double size = bvh_.bounds().sizes().norm();
    SphereSearch taken;
    for (std::size_t i = 0; i < packing_.spheres.size(); ++i) {
      if (!watch_.keeps_on()) return "";
      const InnerSphere& sphere = packing_.spheres[i];
      const double cover = sphere.cover_radius - deviation_;
      if (!(cover >= sphere.radius - tolerance_ && cover >= -tolerance_ &&
            cover <= size + tolerance_)) {
        return sphere_name(i) + " has the cover radius " + millimetres(sphere.cover_radius) +
               " in a shape of " + millimetres(size);
      }
      const double distance = std::sqrt(bvh_.closest(sphere.center).distance_sq);
      if (!(std::abs(sphere.radius) <= distance + tolerance_)) {
        return sphere_name(i) + " reaches " + millimetres(sphere.radius - distance) +
               " through the surface";
      }
      // Spheres without a volume near a hole may lie in front of its opening.
      const bool is_out = sphere.radius == 0.0
                              ? distance > tolerance_
                              : sphere.radius > 0.0 && !bvh_.is_inside(sphere.center);
      if (is_out) return sphere_name(i) + " is not in the shape";
      if (config_.order == PackingOrder::kMedial || sphere.radius <= 0.0) continue;
      if (taken.size() > 0) {
        const double clearance = taken.best(&sphere.center, 1, 0).cost;
        if (!(clearance >= sphere.radius - tolerance_)) {
          return sphere_name(i) + " overlaps another by " + millimetres(sphere.radius - clearance);
        }
      }
      taken.add(sphere.center, sphere.radius);
    }
    return "";
  }

  // Every triangle is covered, by parts that are in one cover sphere each.
  std::string surface_fault() {
    SphereSearch covers;
    for (const InnerSphere& sphere : packing_.spheres) {
      covers.add(sphere.center, sphere.cover_radius - deviation_);
    }
    std::size_t steps_left = 2 * SurfaceCover::max_patches(mesh_, config_);
    std::uint32_t hint = 0;
    std::vector<SurfacePatch> parts;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      parts.assign(1, {mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2)});
      while (!parts.empty()) {
        if (!watch_.keeps_on()) return "";
        SurfacePatch part = parts.back();
        parts.pop_back();
        const SphereSearch::Match match = covers.best(part.corner, 3, hint, 0, tolerance_);
        hint = match.sphere;
        if (match.cost <= tolerance_) continue;
        if (--steps_left == 0 ||
            part.longest_edge() <= kMinPatchEdge * bvh_.bounds().sizes().norm()) {
          return "its cover spheres miss " + millimetres(match.cost) + " of triangle " +
                 std::to_string(t);
        }
        parts.push_back(part.split_off_half());
        parts.push_back(part);
      }
    }
    return "";
  }

  // The certificate's numbers are those of spheres and surface.
  std::string certificate_fault() const {
    const PackingCertificate& certificate = packing_.certificate;
    double gap = deviation_, area = 0.0;
    for (const InnerSphere& sphere : packing_.spheres) {
      if (sphere.radius >= 0.0) gap = std::max(gap, sphere.cover_radius - sphere.radius);
    }
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      area += SurfacePatch{mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2)}.area();
    }
    const double area_rounding = 1e-6 * area + tolerance_ * tolerance_;
    const bool is_right = std::abs(gap - certificate.max_gap) <= 2.0 * tolerance_ &&
                          certificate.mean_gap <= certificate.max_gap + tolerance_ &&
                          std::abs(area - certificate.surface_area) <= area_rounding &&
                          certificate.unreachable_area <= area + area_rounding &&
                          certificate.reached == (certificate.max_gap <= config_.max_error);
    if (is_right) return "";
    return "its certificate is not that of its spheres: the largest gap is " + millimetres(gap) +
           ", stated are " + millimetres(certificate.max_gap);
  }

  std::string interior_fault() {
    const PackingCertificate& certificate = packing_.certificate;
    const double least = std::max(config_.max_error, certificate.max_gap);
    if (certificate.interior_gap < least - tolerance_) {
      return "its interior gap is " + millimetres(certificate.interior_gap) +
             ", less than packing aims at";
    }
    const double gap = certificate.interior_gap - deviation_;
    if (is_interior_covered(mesh_, bvh_, packing_, deviation_, gap, &watch_)) return "";
    return "its cover spheres do not reach all of the interior, which it says is within " +
           millimetres(packing_.certificate.interior_gap);
  }

  const TriangleMesh& mesh_;
  const double deviation_;
  const PackingConfig& config_;
  const Packing& packing_;
  PackingWatch& watch_;
  const TriangleBvh bvh_;
  double tolerance_;
};

}  // namespace

std::string packing_fault(const Shape& shape, const PackingConfig& config, const Packing& packing,
                          const PackingProgress& progress) {
  std::string fault = shape_fault(shape);
  if (!fault.empty()) return fault;
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    const bool is_it = packing.spheres.size() == 1 && packing.spheres[0].center.isZero(0.0) &&
                       packing.spheres[0].radius == sphere->radius &&
                       packing.spheres[0].cover_radius == sphere->radius &&
                       packing.certificate.max_gap == 0.0 &&
                       packing.certificate.interior_gap >= 0.0;
    return is_it ? "" : "it is not the one sphere of its shape";
  }
  PackingWatch watch(progress);
  try {
    const PackedMesh packed = packed_mesh(shape, config);
    if (packed.mesh.triangles.empty()) return "its shape has no triangle";
    fault = PackingCheck(packed, config, packing, &watch).run();
  } catch (const Cancelled&) {
    // The watch knows that it was cancelled.
  }
  return watch.stopped() ? "its check was cancelled" : fault;
}

double tight_interior_gap(const Shape& shape, const PackingConfig& config, const Packing& packing) {
  // Smaller gaps take many more cells to prove.
  constexpr int kHalvings = 4;
  double gap = packing.certificate.interior_gap;
  if (std::holds_alternative<Sphere>(shape)) return gap;
  const PackedMesh packed = packed_mesh(shape, config);
  const TriangleBvh bvh(packed.mesh);
  PackingWatch watch({});
  for (int i = 0; i < kHalvings; ++i) {
    const double half = 0.5 * gap;
    if (half <= packed.deviation ||
        !is_interior_covered(packed.mesh, bvh, packing, packed.deviation, half - packed.deviation,
                             &watch)) {
      break;
    }
    gap = half;
  }
  return gap;
}

}  // namespace ist
