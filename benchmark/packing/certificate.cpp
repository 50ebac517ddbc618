// Tests the certificate at many points on each link's surface and outside.

#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <random>
#include <string>

#include "internal/geometry/triangle_bvh.h"
#include "internal/packing/packer.h"
#include "packing/options.h"
#include "packing/parallel.h"

namespace ist::benchmark {
namespace {

constexpr int kPoints = 1000000;  // of each kind
constexpr int kParts =
    100;  // each with its own random numbers, so the result does not depend on threads
constexpr double kMargin = 0.05;     // [m] about a link
constexpr double kRounding = 1e-12;  // [m]

using Rng = std::mt19937_64;

double uniform(Rng* rng, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(*rng);
}

struct Counts {
  int outside = 0;
  int inner_below = 0;   // d_IST < d_mesh
  int inner_above = 0;   // d_IST > d_mesh + gap
  int outer_above = 0;   // the bound d_out > d_mesh
  double deepest = 0.0;  // [m] largest d_mesh - d_IST
  double sampled = 0.0;  // [m] largest gap of a point of the surface

  void add(const Counts& other) {
    outside += other.outside;
    inner_below += other.inner_below;
    inner_above += other.inner_above;
    outer_above += other.outer_above;
    deepest = std::max(deepest, other.deepest);
    sampled = std::max(sampled, other.sampled);
  }
};

class Trial {
 public:
  explicit Trial(const PandaLink& link) : mesh_(link.mesh), bvh_(link.mesh) {
    packing_ = pack_mesh(mesh_, {});
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      areas_.push_back((mesh_.corner(t, 1) - mesh_.corner(t, 0))
                           .cross(mesh_.corner(t, 2) - mesh_.corner(t, 0))
                           .norm());
    }
  }

  const Packing& packing() const { return packing_; }

  Counts run(std::size_t part) const {
    Rng rng(part);
    Counts counts;
    std::discrete_distribution<std::size_t> by_area(areas_.begin(), areas_.end());
    for (int i = 0; i < kPoints / kParts; ++i)
      check(surface_point(by_area(rng), &rng), 0.0, &counts);
    while (counts.outside < kPoints / kParts) {
      Eigen::Vector3d p;
      for (int k = 0; k < 3; ++k) {
        p[k] = uniform(&rng, bvh_.bounds().min()[k] - kMargin, bvh_.bounds().max()[k] + kMargin);
      }
      if (bvh_.is_inside(p)) continue;
      ++counts.outside;
      check(p, std::sqrt(bvh_.closest(p).distance_sq), &counts);
    }
    return counts;
  }

 private:
  Eigen::Vector3d surface_point(std::size_t t, Rng* rng) const {
    double u = uniform(rng, 0.0, 1.0), v = uniform(rng, 0.0, 1.0);
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    const Eigen::Vector3d& a = mesh_.corner(t, 0);
    return a + u * (mesh_.corner(t, 1) - a) + v * (mesh_.corner(t, 2) - a);
  }

  // Compares the bounds of a point, by brute force over the spheres, with the truth.
  void check(const Eigen::Vector3d& p, double d_mesh, Counts* counts) const {
    double inner = std::numeric_limits<double>::infinity(), outer = inner;
    for (const InnerSphere& sphere : packing_.spheres) {
      const double to_center = (p - sphere.center).norm();
      inner = std::min(inner, to_center - sphere.radius);
      outer = std::min(outer, to_center - sphere.cover_radius);
    }
    counts->inner_below += inner < d_mesh - kRounding ? 1 : 0;
    counts->inner_above += inner > d_mesh + packing_.certificate.max_gap + kRounding ? 1 : 0;
    counts->outer_above += outer > d_mesh + kRounding ? 1 : 0;
    counts->deepest = std::max(counts->deepest, d_mesh - inner);
    if (d_mesh == 0.0) counts->sampled = std::max(counts->sampled, inner);
  }

  const TriangleMesh& mesh_;
  TriangleBvh bvh_;
  Packing packing_;
  std::vector<double> areas_;
};

}  // namespace

Table certificate_table() {
  Table table("certificate",
              {"link", "certified gap [mm]", "sampled [mm]", "above it [%]",
               "points on the surface and outside", "d_IST < d_mesh", "by at most [mm]",
               "d_IST > d_mesh + gap", "bound > d_mesh"},
              1);
  for (const std::string& link : panda_names()) table.place({link});
  return table;
}

bool measure_certificate(const Options& options, Table* table) {
  const std::vector<PandaLink> links = panda_links(options);
  for (const PandaLink& link : links) {
    const Trial trial(link);
    Counts counts;
    std::mutex adding;
    parallel_for(kParts, options.threads, [&](std::size_t part) {
      const Counts some = trial.run(part);
      const std::lock_guard<std::mutex> lock(adding);
      counts.add(some);
    });
    const double gap = trial.packing().certificate.max_gap;
    table->add({link.name, text("%.3f", 1e3 * gap), text("%.3f", 1e3 * counts.sampled),
                text("%.1f", 100.0 * (gap / counts.sampled - 1.0)),
                std::to_string(kPoints) + " + " + std::to_string(counts.outside),
                std::to_string(counts.inner_below),
                text("%.3g", 1e3 * std::max(counts.deepest, 0.0)),
                std::to_string(counts.inner_above), std::to_string(counts.outer_above)});
  }
  return !links.empty();
}

}  // namespace ist::benchmark
