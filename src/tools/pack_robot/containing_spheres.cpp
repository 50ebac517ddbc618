#include "containing_spheres.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <variant>

#include "internal/geometry/numbers.h"
#include "internal/geometry/tessellation.h"
#include "internal/packing/packing_check.h"
#include "internal/packing/packing_report.h"

namespace ist::tools {
namespace {

constexpr int kPointsOfSphere = 100;
constexpr int kPointsOfLink = 5000;
constexpr double kDeviation = 0.01;  // of the triangles of a primitive, of its radius

using Points = std::vector<Eigen::Vector3d>;

// [m] How far a point is from the nearest sphere; negative inside.
double distance_to(const std::vector<LinkSphere>& spheres, const Eigen::Vector3d& p_L) {
  double least = kInfinity;
  for (const LinkSphere& sphere : spheres) {
    least = std::min(least, (p_L - sphere.center).norm() - sphere.radius);
  }
  return least;
}

// Points on the surface, spread by area. Points of an element that are inside another one are left
// out: they are not on the surface of the link.
Points surface_points(const Solid& solid, const LinkGeometry& geometry, std::mt19937* random) {
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
  std::vector<double> areas;
  for (const GeometryElement& element : geometry) {
    const TriangleMesh mesh = mesh_of(element.shape, kDeviation);
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      triangles.push_back({element.X_LE * mesh.corner(t, 0), element.X_LE * mesh.corner(t, 1),
                           element.X_LE * mesh.corner(t, 2)});
      const auto& [a, b, c] = triangles.back();
      areas.push_back((b - a).cross(c - a).norm());
    }
  }
  std::discrete_distribution<std::size_t> triangle(areas.begin(), areas.end());
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Points points;
  for (int i = 0; i < kPointsOfLink; ++i) {
    const auto& [a, b, c] = triangles[triangle(*random)];
    const double u = std::sqrt(unit(*random)), v = unit(*random);
    const Eigen::Vector3d p_L = (1.0 - u) * a + u * (1.0 - v) * b + u * v * c;
    constexpr double kOnSurface = 1e-6;  // [m]
    if (geometry.size() == 1 || solid.signed_distance(p_L).distance > -kOnSurface) {
      points.push_back(p_L);
    }
  }
  return points;
}

// Points inside the link, evenly spread.
Points inner_points(const Solid& solid, const Points& surface, std::mt19937* random) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& p_L : surface) box.extend(p_L);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Points points;
  constexpr int kTries = 100 * kPointsOfLink;  // a thin part of its box, or nothing, may be inside
  for (int i = 0; i < kTries && points.size() < kPointsOfLink; ++i) {
    const Eigen::Vector3d share(unit(*random), unit(*random), unit(*random));
    const Eigen::Vector3d p_L = box.min() + box.sizes().cwiseProduct(share);
    if (solid.is_inside(p_L)) points.push_back(p_L);
  }
  return points;
}

Points points_of(const LinkSphere& sphere, std::mt19937* random) {
  std::normal_distribution<double> normal;
  Points points;
  for (int i = 0; i < kPointsOfSphere; ++i) {
    const Eigen::Vector3d way(normal(*random), normal(*random), normal(*random));
    points.emplace_back(sphere.center + sphere.radius * way.normalized());
  }
  return points;
}

// [m] No point inside an element is farther from the link's cover spheres.
double largest_gap(const LinkModel& link, const LinkGeometry& geometry,
                   const PackingConfig& config) {
  double largest = 0.0;
  for (const GeometryElement& element : geometry) {
    Packing packing = link.packing;
    for (InnerSphere& sphere : packing.spheres) {
      sphere.center = element.X_LE.inverse() * sphere.center;
    }
    largest = std::max(largest, tight_interior_gap(element.shape, config, packing));
  }
  return largest;
}

double mean(const std::vector<double>& values) {
  return values.empty() ? 0.0
                        : std::accumulate(values.begin(), values.end(), 0.0) /
                              static_cast<double>(values.size());
}

double percentile_95(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(0.95 * (values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

std::vector<LinkSphere> containing_spheres(const LinkModel& link, const LinkGeometry& geometry,
                                           const PackingConfig& config) {
  const double gap = largest_gap(link, geometry, config);
  std::vector<LinkSphere> all;
  for (const InnerSphere& sphere : link.packing.spheres) {
    all.push_back({sphere.center, sphere.cover_radius + gap});
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const LinkSphere& a, const LinkSphere& b) { return a.radius > b.radius; });
  std::vector<LinkSphere> spheres;
  for (const LinkSphere& sphere : all) {
    const auto contains = [&](const LinkSphere& other) {
      return (sphere.center - other.center).norm() + sphere.radius <= other.radius;
    };
    if (std::none_of(spheres.begin(), spheres.end(), contains)) spheres.push_back(sphere);
  }
  return spheres;
}

SphereFit measure_fit(const LinkModel& link, const LinkGeometry& geometry,
                      const std::vector<LinkSphere>& spheres) {
  std::mt19937 random(1);
  SphereFit fit;
  fit.link = link.name;
  fit.num_spheres = spheres.size();
  const Points surface = surface_points(link.solid, geometry, &random);
  const Points inside = inner_points(link.solid, surface, &random);
  const auto is_covered = [&](const Eigen::Vector3d& p_L) {
    return distance_to(spheres, p_L) <= 0.0;
  };
  fit.coverage =
      inside.empty()
          ? 1.0
          : static_cast<double>(std::count_if(inside.begin(), inside.end(), is_covered)) /
                static_cast<double>(inside.size());
  std::vector<double> gaps, protrusions;
  for (const Eigen::Vector3d& p_L : surface) {
    gaps.push_back(std::max(distance_to(spheres, p_L), 0.0));
  }
  fit.surface_gap_mean = mean(gaps);
  fit.surface_gap_p95 = percentile_95(gaps);
  fit.max_uncovered_gap = gaps.empty() ? 0.0 : *std::max_element(gaps.begin(), gaps.end());
  double volume = 0.0;
  for (const LinkSphere& sphere : spheres) {
    volume += 4.0 / 3.0 * kPi * std::pow(sphere.radius, 3);
    for (const Eigen::Vector3d& p_L : points_of(sphere, &random)) {
      const double distance = link.solid.signed_distance(p_L).distance;
      if (distance > 0.0) protrusions.push_back(distance);
    }
  }
  fit.protrusion = static_cast<double>(protrusions.size()) /
                   static_cast<double>(kPointsOfSphere * spheres.size());
  fit.protrusion_dist_mean = mean(protrusions);
  fit.protrusion_dist_p95 = percentile_95(protrusions);
  const double solid = measure_packing(link.solid, link.packing.spheres).solid_volume;
  fit.volume_ratio = solid > 0.0 ? volume / solid : kInfinity;
  return fit;
}

void print_fits(const std::vector<SphereFit>& fits) {
  std::printf("\n%-24s %8s %9s %11s %11s %9s %9s %9s %9s %7s\n", "containing spheres", "num",
              "coverage", "protrusion", "dist mean", "dist p95", "gap mean", "gap p95", "max gap",
              "volume");
  std::printf("%-24s %8s %9s %11s %11s %9s %9s %9s %9s %7s\n", "", "", "%", "%", "mm", "mm", "mm",
              "mm", "mm", "ratio");
  for (const SphereFit& fit : fits) {
    std::printf("%-24s %8zu %9.2f %11.1f %11.2f %9.2f %9.3f %9.3f %9.3f %7.2f\n", fit.link.c_str(),
                fit.num_spheres, 100.0 * fit.coverage, 100.0 * fit.protrusion,
                1e3 * fit.protrusion_dist_mean, 1e3 * fit.protrusion_dist_p95,
                1e3 * fit.surface_gap_mean, 1e3 * fit.surface_gap_p95, 1e3 * fit.max_uncovered_gap,
                fit.volume_ratio);
  }
}

}  // namespace ist::tools
