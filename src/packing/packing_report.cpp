#include "internal/packing/packing_report.h"
#include "internal/geometry/solid_queries.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "sphere_search.h"

namespace ist {
namespace {

constexpr int kVolumeSamples = 100000;
constexpr int kReportDirections = 100;
constexpr int kReportSteps = 12;
constexpr double kTouch = 1e-9;  // [m]
constexpr double kGoldenAngle = 2.39996322972865332;

// Evenly spread in the unit cube (Roberts' R3 sequence).
Eigen::Vector3d cube_point(int i) {
  const Eigen::Vector3d step(0.81917251339616444, 0.67104360670378921, 0.54970047790197027);
  const Eigen::Vector3d p = Eigen::Vector3d::Constant(0.5) + i * step;
  return p - p.array().floor().matrix();
}

// Evenly spread on the unit sphere (a Fibonacci lattice).
Eigen::Vector3d direction(int i) {
  const double z = 1.0 - (2.0 * i + 1.0) / kReportDirections;
  const double radius = std::sqrt(1.0 - z * z);
  return {radius * std::cos(kGoldenAngle * i), radius * std::sin(kGoldenAngle * i), z};
}

// How much nearer the sphere is than the surface to the first point outside on a ray from its
// centre, found by sphere tracing.
double protrusion_along(const Solid& solid, const InnerSphere& sphere, const Eigen::Vector3d& ray) {
  double t = sphere.radius;
  for (int i = 0; i < kReportSteps; ++i) {
    const Eigen::Vector3d p = sphere.center + t * ray;
    const double distance =
        std::abs(distance_outside(solid, p, std::numeric_limits<double>::infinity()).distance);
    const double nearer = sphere.radius + distance - t;
    // Along a ray this does not grow.
    if (nearer <= kTouch) return 0.0;
    if (!solid.is_inside(p)) return nearer;
    t += std::min(nearer, 0.98 * distance);  // short of the mesh
  }
  return 0.0;
}

double protrusion(const Solid& solid, const InnerSphere& sphere) {
  const double depth = -solid.signed_distance(sphere.center).distance;
  double largest = std::max(0.0, sphere.radius - depth);
  if (solid.is_closed()) return largest;
  for (int i = 0; i < kReportDirections; ++i) {
    largest = std::max(largest, protrusion_along(solid, sphere, direction(i)));
  }
  return largest;
}

}  // namespace

PackingReport measure_packing(const Solid& solid, const std::vector<InnerSphere>& spheres) {
  PackingReport report;
  SphereSearch search;
  Eigen::AlignedBox3d box;
  for (const InnerSphere& sphere : spheres) {
    if (sphere.radius > 0.0) {
      report.protrusion = std::max(report.protrusion, protrusion(solid, sphere));
      if (search.size() > 0) {
        const double nearest = search.best(&sphere.center, 1, 0).cost;
        report.overlap = std::max(report.overlap, sphere.radius - nearest);
      }
    }
    search.add(sphere.center, sphere.radius);
    box.extend(Eigen::Vector3d(sphere.center.array() - sphere.cover_radius));
    box.extend(Eigen::Vector3d(sphere.center.array() + sphere.cover_radius));
  }
  if (spheres.empty()) return report;
  int inside = 0, filled = 0;
  std::uint32_t hint = 0;
  for (int i = 0; i < kVolumeSamples; ++i) {
    const Eigen::Vector3d p = box.min() + cube_point(i).cwiseProduct(box.sizes());
    const SphereSearch::Match match = search.best(&p, 1, hint);
    hint = match.sphere;
    const bool in_sphere = match.cost < 0.0;
    if (in_sphere) ++filled;
    if (in_sphere || solid.is_inside(p)) ++inside;
  }
  report.solid_volume = box.volume() * inside / kVolumeSamples;
  report.filled_volume = box.volume() * filled / kVolumeSamples;
  return report;
}

}  // namespace ist
