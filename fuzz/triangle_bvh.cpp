// Distances, supports and winding numbers of small meshes against brute force over all triangles.
// Covers: src/geometry/triangle_bvh.cpp src/geometry/triangle_bvh_builder.cpp
// Covers: src/geometry/closest_kernel.cpp src/geometry/support_kernel.cpp
// Covers: src/geometry/winding_kernel.cpp src/geometry/closest_point_on_triangle.cpp
// Longest input: 200

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "internal/geometry/triangle_bvh.h"
#include "support/byte_reader.h"
#include "support/check.h"
#include "support/meshes_from_bytes.h"
#include "support/oracle.h"

namespace {

using ist::fuzz::ByteReader;

void check_closest(const ist::TriangleMesh& mesh, const ist::TriangleBvh& bvh, double size,
                   ByteReader* in) {
  const Eigen::Vector3d p = ist::fuzz::point_near(mesh, size, in);
  const double truth = ist::test::oracle_distance(mesh, p);
  const double rounding = 1e-9 * (size + truth);
  const double tolerance = in->flag() ? 0.0 : 0.01 * size;
  const ist::ClosestPoint found = bvh.closest(p, std::numeric_limits<double>::infinity(),
                                              Eigen::Vector3d::Zero(), 0.0, tolerance);
  const double distance = std::sqrt(found.distance_sq);
  FUZZ_CHECK(distance >= truth - rounding, "distance %.12g, truth %.12g", distance, truth);
  FUZZ_CHECK(distance <= truth + tolerance + rounding, "distance %.12g, truth %.12g, tolerance %g",
             distance, truth, tolerance);
  FUZZ_CHECK(found.lower_bound <= truth + rounding, "lower bound %.12g, truth %.12g",
             found.lower_bound, truth);
  FUZZ_CHECK(std::abs((found.point - p).norm() - distance) <= rounding,
             "witness at %.12g, not %.12g", (found.point - p).norm(), distance);
  FUZZ_CHECK(found.triangle < mesh.triangles.size(), "triangle %u", found.triangle);
  const double off =
      ist::test::oracle_triangle(found.point, mesh.corner(found.triangle, 0),
                                 mesh.corner(found.triangle, 1), mesh.corner(found.triangle, 2));
  FUZZ_CHECK(off <= rounding, "witness is %g m off its triangle", off);
  // A search within a range finds what is in it, and nothing else.
  const double range = truth * in->between(0.0, 2.0);
  const ist::ClosestPoint within = bvh.closest(p, range * range);
  if (range > truth + rounding) {
    FUZZ_CHECK(std::abs(std::sqrt(within.distance_sq) - truth) <= rounding,
               "within %.12g: %.12g, truth %.12g", range, std::sqrt(within.distance_sq), truth);
  } else if (range < truth - rounding) {
    FUZZ_CHECK(!(within.distance_sq < range * range), "within %.12g: %.12g, truth %.12g", range,
               std::sqrt(within.distance_sq), truth);
  }
}

void check_support(const ist::TriangleMesh& mesh, const ist::TriangleBvh& bvh, double size,
                   ByteReader* in) {
  Eigen::Vector3d n = in->vector(1.0);
  if (n.norm() < 1e-3) n = Eigen::Vector3d::UnitX();
  n.normalize();
  double truth = -std::numeric_limits<double>::infinity();
  double reach = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      truth = std::max(truth, n.dot(mesh.corner(t, k)));
      reach = std::max(reach, mesh.corner(t, k).norm());
    }
  }
  const double tolerance = in->flag() ? 0.0 : 0.02 * size;
  const double found = bvh.support(n, tolerance);
  const double rounding = 1e-12 * (size + reach);
  FUZZ_CHECK(found >= truth - rounding && found <= truth + tolerance + rounding,
             "support %.15g, truth %.15g, tolerance %g", found, truth, tolerance);
}

void check_winding(const ist::TriangleMesh& mesh, const ist::TriangleBvh& bvh, double size,
                   ByteReader* in) {
  const Eigen::Vector3d p = ist::fuzz::point_near(mesh, size, in);
  // On the surface the winding number jumps, and its own rounding decides.
  if (ist::test::oracle_distance(mesh, p) < 1e-6 * size) return;
  const double truth = ist::test::oracle_winding(mesh, p);
  double error;
  const double found = bvh.winding_number(p), quick = bvh.quick_winding_number(p, &error);
  FUZZ_CHECK(std::abs(found - truth) <= 0.01, "winding number %.6g, truth %.6g", found, truth);
  FUZZ_CHECK(std::abs(quick - truth) <= error, "quick winding number %.6g, truth %.6g", quick,
             truth);
  if (std::abs(truth - 0.5) > 0.02) {
    FUZZ_CHECK(bvh.is_inside(p) == (truth > 0.5), "inside %d, winding number %.6g",
               static_cast<int>(bvh.is_inside(p)), truth);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  const ist::TriangleMesh mesh = ist::fuzz::mesh_from(&in);
  if (mesh.triangles.empty()) return 0;
  const double extent = ist::fuzz::extent(mesh);
  if (!(extent > 1e-4)) return 0;
  const ist::TriangleBvh bvh(mesh);
  FUZZ_CHECK(bvh.size() == mesh.triangles.size(), "%zu triangles", bvh.size());
  for (int i = 0; i < 3; ++i) check_closest(mesh, bvh, extent, &in);
  check_support(mesh, bvh, extent, &in);
  check_winding(mesh, bvh, extent, &in);
  return 0;
}
