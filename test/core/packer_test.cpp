#include "internal/packing/packer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "geometry/orientation.h"
#include "internal/geometry/triangle_bvh.h"
#include "internal/packing/packing_check.h"
#include "internal/packing/packing_report.h"
#include "ist_proximity/geometry/solid.h"
#include "ist_proximity/tree/inner_sphere_tree.h"
#include "support/errors.h"
#include "support/hostile_meshes.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr PackingOrder kOrders[] = {PackingOrder::kMedial, PackingOrder::kDisjoint,
                                    PackingOrder::kVolume};

// Orients the triangles as load_mesh does. Vertices that it would merge stay separate.
TriangleMesh as_loaded(TriangleMesh mesh) {
  const TriangleMesh before = test::merged(mesh);
  TriangleMesh after = before;
  orient_outward(&after);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (after.triangles[t] != before.triangles[t]) {
      std::swap(mesh.triangles[t][1], mesh.triangles[t][2]);
    }
  }
  return mesh;
}

// [m] The distance of p to the nearest of the spheres with their inner or their cover radius.
double distance_to(const std::vector<InnerSphere>& spheres, double InnerSphere::*radius,
                   const Eigen::Vector3d& p) {
  double least = 1e300;
  for (const InnerSphere& sphere : spheres) {
    least = std::min(least, (p - sphere.center).norm() - sphere.*radius);
  }
  return least;
}

// What the certificate says of one point, and the tree's bound.
void check_point(const TriangleMesh& mesh, const Packing& packing, const InnerSphereTree& tree,
                 const Eigen::Vector3d& p, double rounding) {
  const double truth = test::oracle_signed_distance(mesh, p);
  const double inner = distance_to(packing.spheres, &InnerSphere::radius, p);
  const double cover = distance_to(packing.spheres, &InnerSphere::cover_radius, p);
  const double in_float = tree.cover_distance(p);
  ASSERT_LE(in_float, cover) << "rounding to float may only lower the bound";
  ASSERT_GT(in_float, cover - 1e-5 * (1.0 + p.norm()));
  if (truth < 0.0) {
    ASSERT_LE(cover, packing.certificate.interior_gap + rounding) << p.transpose();
    return;
  }
  ASSERT_LE(cover, truth + rounding) << p.transpose();
  ASSERT_LE(inner, truth + packing.certificate.max_gap + rounding) << p.transpose();
}

// The certificate holds at points about the mesh, and on its surface, where the gap shows.
void expect_certificate_holds(const TriangleMesh& mesh, const Packing& packing, int points) {
  test::Rng rng(35);
  const Eigen::AlignedBox3d box = test::bounds(mesh);
  const double size = box.sizes().norm(), far = box.center().cwiseAbs().maxCoeff();
  const double rounding = 1e-9 * size + 1e-14 * far;
  const InnerSphereTree tree(packing);
  for (int i = 0; i < points && !testing::Test::HasFatalFailure(); ++i) {
    const Eigen::Vector3d half = 0.5 * box.sizes() + Eigen::Vector3d::Constant(0.1 * size + 1e-3);
    check_point(mesh, packing, tree,
                box.center() + half.cwiseProduct(test::random_vector(&rng, 1.0)), rounding);
    const std::size_t t = static_cast<std::size_t>(i) % mesh.triangles.size();
    double u = test::uniform(&rng, 0.0, 1.0), v = test::uniform(&rng, 0.0, 1.0);
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    check_point(mesh, packing, tree,
                mesh.corner(t, 0) + u * (mesh.corner(t, 1) - mesh.corner(t, 0)) +
                    v * (mesh.corner(t, 2) - mesh.corner(t, 0)),
                rounding);
  }
}

// Inner spheres are inside, and those of disjoint orders do not overlap.
void expect_disjoint(const TriangleMesh& mesh, const std::vector<InnerSphere>& spheres) {
  for (std::size_t i = 0; i < spheres.size(); ++i) {
    if (spheres[i].radius <= 0.0) continue;  // no inner sphere
    EXPECT_GT(test::oracle_winding(mesh, spheres[i].center), 0.5);
    EXPECT_LE(spheres[i].radius, test::oracle_distance(mesh, spheres[i].center) + 1e-9);
    double least = 1e300;
    std::size_t nearest = i;
    for (std::size_t j = 0; j < i; ++j) {
      const double gap = (spheres[i].center - spheres[j].center).norm() - spheres[j].radius;
      if (gap < least) least = gap, nearest = j;
    }
    ASSERT_GE(least + 1e-9, spheres[i].radius) << i << " and " << nearest;
  }
}

// Each is packed in every order with a certificate that holds, or refused with its fault.
TEST(PackMesh, HostileMeshesArePackedOrRefused) {
  for (const test::HostileMesh& hostile : test::hostile_meshes()) {
    for (const PackingOrder order : kOrders) {
      SCOPED_TRACE(hostile.name + ", order " + std::to_string(static_cast<int>(order)));
      PackingConfig config;
      config.order = order;
      config.max_error = (order == PackingOrder::kMedial ? 1.0 : 2.0) * hostile.max_error;
      if (!hostile.fault.empty()) {
        test::expect_says(test::error_of([&] { pack_mesh(hostile.mesh, config); }), hostile.fault);
        continue;
      }
      const TriangleMesh mesh = as_loaded(hostile.mesh);
      const Packing packing = pack_mesh(mesh, config);
      EXPECT_TRUE(packing.certificate.reached);
      EXPECT_LE(packing.certificate.max_gap, config.max_error);
      expect_certificate_holds(mesh, packing, order == PackingOrder::kMedial ? 300 : 100);
      if (order != PackingOrder::kMedial) expect_disjoint(mesh, packing.spheres);
      EXPECT_EQ(packing_fault(mesh, config, packing), "") << "the cache would refuse it";
    }
  }
}

// Points below the surface, down to a depth of a few gaps, are the hardest to cover.
TEST(PackMesh, InteriorIsCoveredBelowTheSurface) {
  test::Rng rng(9);
  for (const test::HostileMesh& hostile : test::hostile_meshes()) {
    if (!hostile.fault.empty()) continue;
    SCOPED_TRACE(hostile.name);
    const TriangleMesh mesh = as_loaded(hostile.mesh);
    const TriangleBvh bvh(mesh);
    const double size = bvh.bounds().sizes().norm();
    PackingConfig config;
    config.max_error = 0.002 * size;
    config.max_spheres = 200;
    const Packing packing = pack_mesh(mesh, config);
    const double gap = packing.certificate.interior_gap;
    for (int i = 0; i < 3000; ++i) {
      const auto t = static_cast<std::size_t>(i) % mesh.triangles.size();
      const double u = test::uniform(&rng, 0, 1), v = test::uniform(&rng, 0, 1 - u);
      const Eigen::Vector3d p = mesh.corner(t, 0) * (1 - u - v) + mesh.corner(t, 1) * u +
                                mesh.corner(t, 2) * v + test::random_vector(&rng, 4.0 * gap);
      if (!bvh.is_inside(p)) continue;
      ASSERT_LE(distance_to(packing.spheres, &InnerSphere::cover_radius, p), gap + 1e-9 * size)
          << p.transpose();
    }
  }
}

// Regression: spheres near a hole bulged through it, or came nearer to points in front of it than
// its rim does, by up to 5 mm on links of the Franka Panda.
TEST(PackMesh, InnerSpheresDoNotProtrudeThroughHoles) {
  const TriangleMesh sphere = test::icosphere(0.1, 2);
  TriangleMesh with_hole = sphere;
  with_hole.triangles.resize(with_hole.triangles.size() - 6);
  for (const TriangleMesh& mesh : {test::open_box({0.1, 0.1, 0.2}), with_hole}) {
    PackingConfig config;
    config.max_error = 0.01;
    const Packing packing = pack_mesh(mesh, config);
    test::Rng rng(3);
    int before_hole = 0;
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.15);
      const double inner = distance_to(packing.spheres, &InnerSphere::radius, p);
      if (inner > 0.1) continue;
      const double distance = test::oracle_distance(mesh, p);
      if (inner >= distance) continue;
      ++before_hole;
      ASSERT_GT(test::oracle_winding(mesh, p), 0.5) << p.transpose() << ": " << distance - inner;
    }
    EXPECT_GT(before_hole, 100) << "points inside";
    const Solid solid({GeometryElement{mesh, Eigen::Isometry3d::Identity(), ""}});
    EXPECT_LT(measure_packing(solid, packing.spheres).protrusion, 1e-6);
  }
}

// Triangles of any size anywhere: a soup with all edges open, the same twice (also shifted a little
// in its own planes), a closed sphere through it, and far from the origin.
std::vector<std::pair<std::string, TriangleMesh>> random_meshes(test::Rng* rng) {
  TriangleMesh soup;
  for (std::uint32_t t = 0; t < 40; ++t) {
    const Eigen::Vector3d place = test::random_vector(rng, 0.1);
    const double size = std::pow(10.0, test::uniform(rng, -4.0, -1.0));
    for (int k = 0; k < 3; ++k) soup.vertices.push_back(place + test::random_vector(rng, size));
    soup.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  TriangleMesh slid = soup;
  for (std::size_t t = 0; t < slid.triangles.size(); ++t) {
    const Eigen::Vector3d by = 0.3 * (soup.corner(t, 1) - soup.corner(t, 0));
    for (const std::uint32_t v : slid.triangles[t]) slid.vertices[v] += by;
  }
  const TriangleMesh with_sphere = test::joined(soup, test::icosphere(0.06, 2));
  return {{"soup", soup},
          {"soup and the same again", test::joined(soup, soup)},
          {"soup with coplanar neighbours", test::joined(soup, slid)},
          {"sphere in a soup", with_sphere},
          {"far away", test::shifted(with_sphere, {3.0, -20.0, 1.0})}};
}

TEST(PackMesh, CertificateHoldsOnRandomMeshes) {
  test::Rng rng(77);
  for (const auto& [name, mesh] : random_meshes(&rng)) {
    for (const PackingOrder order : {PackingOrder::kMedial, PackingOrder::kDisjoint}) {
      SCOPED_TRACE(name + ", order " + std::to_string(static_cast<int>(order)));
      PackingConfig config;
      config.max_error = 0.01;
      config.order = order;
      const Packing packing = pack_mesh(mesh, config);
      EXPECT_TRUE(packing.certificate.reached);
      expect_certificate_holds(mesh, packing, 100);
    }
  }
}

// The inscribed sphere of a cube comes first, then the eight in its corners: each touches three
// faces and the first sphere.
TEST(PackMesh, VolumeOrderTakesTheLargestFirst) {
  PackingConfig config;
  config.max_error = 0.002;
  config.max_spheres = 100;
  config.order = PackingOrder::kVolume;
  const std::vector<InnerSphere> spheres = pack_mesh(test::box({0.2, 0.2, 0.2}), config).spheres;
  ASSERT_GT(spheres.size(), 30U);
  EXPECT_NEAR(spheres[0].radius, 0.1, 0.001);
  const double corner = 0.1 * (2.0 - std::sqrt(3.0));
  for (std::size_t i = 1; i <= 8; ++i) EXPECT_NEAR(spheres[i].radius, corner, 0.1 * corner) << i;
  EXPECT_LT(spheres[30].radius, corner);
}

TEST(PackMesh, CertificateHoldsWhenMaxSpheresIsReachedFirst) {
  const TriangleMesh mesh = test::torus(0.1, 0.03, 32, 16);
  PackingConfig config;
  config.max_error = 0.001;
  config.max_spheres = 30;
  const Packing packing = pack_mesh(mesh, config);
  EXPECT_EQ(packing.spheres.size(), 30U);
  EXPECT_FALSE(packing.certificate.reached);
  EXPECT_GT(packing.certificate.max_gap, 0.001);
  expect_certificate_holds(mesh, packing, 400);
}

TEST(PackMesh, ReportsProgress) {
  double last = 0.0;
  pack_mesh(test::l_shape(0.2, 0.05), {}, [&](double fraction) {
    EXPECT_GE(fraction, last);
    EXPECT_LE(fraction, 1.0);
    last = fraction;
    return true;
  });
  EXPECT_EQ(last, 1.0);
}

// A mesh in millimetres takes minutes. After a request to stop, no later step may start.
TEST(PackMesh, DoesNothingMoreAfterARequestToStop) {
  for (const double stop_at : {0.0, 0.3, 0.6, 0.9}) {
    int calls_after = 0;
    bool has_asked = false;  // to stop
    const Packing stopped = pack_mesh(test::l_shape(0.2, 0.05), {}, [&](double fraction) {
      calls_after += has_asked ? 1 : 0;
      has_asked = has_asked || fraction >= stop_at;
      return !has_asked;
    });
    EXPECT_TRUE(has_asked);
    EXPECT_EQ(calls_after, 0) << stop_at;
    EXPECT_GT(stopped.certificate.interior_gap, 0.1) << stop_at;
  }
  PackingConfig few;
  few.max_spheres = 200;
  int calls = 0;
  pack_mesh(test::l_shape(200.0, 50.0), few, [&](double fraction) {
    calls += fraction >= 0.6 ? 1 : 0;
    return calls < 3;
  });
  EXPECT_EQ(calls, 3);
}

TEST(PackElement, PrimitivesAreCoveredAsTheyAre) {
  test::Rng rng(8);
  for (const Shape& shape :
       {Shape(Sphere{0.07}), Shape(Cylinder{0.05, 0.2}), Shape(Box{{0.1, 0.05, 0.2}})}) {
    PackingConfig config;
    config.max_error = 0.004;
    const Packing packing = pack_element(shape, config);
    EXPECT_TRUE(packing.certificate.reached);
    const InnerSphereTree tree(packing);
    const Solid solid({GeometryElement{shape, Eigen::Isometry3d::Identity(), ""}});
    for (int i = 0; i < 20000; ++i) {
      const Eigen::Vector3d p = test::random_vector(&rng, 0.15);
      const double truth = solid.signed_distance(p).distance;
      const double outer = tree.cover_distance(p);
      if (truth < 0.0) {
        ASSERT_LE(outer, tree.interior_gap());
      } else {
        ASSERT_LE(outer, truth);
        ASSERT_LE(tree.inner_distance(p), truth + packing.certificate.max_gap + 1e-6);
        ASSERT_GE(tree.inner_distance(p), truth - 1e-6);
      }
    }
  }
}

}  // namespace
}  // namespace ist
