#include "internal/geometry/tessellation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/meshes.h"

namespace ist {
namespace {

constexpr double kPi = 3.14159265358979323846;

// The largest ratio of longest edge to height of any triangle; 1.15 for equilateral ones.
double worst_aspect(const TriangleMesh& mesh, std::size_t first, std::size_t last) {
  double worst = 0.0;
  for (std::size_t t = first; t < last; ++t) {
    double longest = 0.0;
    for (int k = 0; k < 3; ++k) {
      longest = std::max(longest, (mesh.corner(t, (k + 1) % 3) - mesh.corner(t, k)).norm());
    }
    const Eigen::Vector3d& a = mesh.corner(t, 0);
    const double doubled_area = (mesh.corner(t, 1) - a).cross(mesh.corner(t, 2) - a).norm();
    worst = std::max(worst, longest * longest / doubled_area);
  }
  return worst;
}

TEST(Tessellation, boxIsExact) {
  const Tessellation box = tessellate(Box{{0.2, 0.4, 0.6}});
  EXPECT_EQ(box.deviation, 0.0);
  EXPECT_EQ(box.mesh.triangles.size(), 12U);
  EXPECT_EQ(test::open_edges(box.mesh), 0U);
  EXPECT_NEAR(test::signed_volume(box.mesh), 0.2 * 0.4 * 0.6, 1e-15);
  EXPECT_EQ(test::bounds(box.mesh).max(), Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(test::bounds(box.mesh).min(), Eigen::Vector3d(-0.1, -0.2, -0.3));
}

TEST(Tessellation, cylinderIsInscribedAndClosed) {
  const Cylinder cylinder{0.05, 0.3};
  for (const double wanted : {1e-2, 1e-3, 1e-4, 1e-5}) {
    const Tessellation result = tessellate(cylinder, wanted);
    EXPECT_LE(result.deviation, wanted);
    EXPECT_EQ(test::open_edges(result.mesh), 0U);
    EXPECT_GT(test::signed_volume(result.mesh), 0.0);
    EXPECT_LT(test::signed_volume(result.mesh), kPi * 0.05 * 0.05 * 0.3);
    for (const Eigen::Vector3d& v : result.mesh.vertices) {
      EXPECT_LE(std::hypot(v.x(), v.y()), cylinder.radius);
      EXPECT_LE(std::abs(v.z()), 0.5 * cylinder.length);
    }
    EXPECT_EQ(test::bounds(result.mesh).max().z(), 0.15);
    EXPECT_EQ(test::bounds(result.mesh).min().z(), -0.15);
  }
}

// Measures the deviation where the prism's side is nearest to the axis.
TEST(Tessellation, cylinderDeviationIsWhatIsMeasured) {
  const Cylinder cylinder{0.05, 0.3};
  const Tessellation result = tessellate(cylinder, 1e-3);
  double nearest = cylinder.radius;
  for (std::size_t t = 0; t < result.mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d& a = result.mesh.corner(t, k);
      const Eigen::Vector3d& b = result.mesh.corner(t, (k + 1) % 3);
      const bool on_axis = std::min(a.head<2>().norm(), b.head<2>().norm()) < 1e-9;
      if (!on_axis) nearest = std::min(nearest, 0.5 * (a + b).head<2>().norm());
    }
  }
  EXPECT_GE(result.deviation, cylinder.radius - nearest);
  EXPECT_LE(result.deviation, (cylinder.radius - nearest) * 1.001);
}

TEST(Tessellation, cylinderSidesStayInRange) {
  // At least 8 sides, each with two lateral triangles and one in each cap; at most 512.
  EXPECT_EQ(tessellate(Cylinder{1.0, 0.1}, 10.0).mesh.triangles.size(), 8U * 2 + 16);
  const Tessellation finest = tessellate(Cylinder{1.0, 0.001}, 0.0);
  EXPECT_EQ(finest.mesh.triangles.size(), 512U * 2 + 1024);
  EXPECT_GT(finest.deviation, 0.0);
  // A thin rod has no excessive number of triangles.
  EXPECT_LE(tessellate(Cylinder{0.001, 100.0}, 1e-9).mesh.triangles.size(), 512U * 512 * 2 + 1024);
}

TEST(Tessellation, cylinderWallHasNoNeedles) {
  constexpr std::size_t kSides = 20;  // what 0.5 mm asks for at this radius
  ASSERT_EQ(tessellate(Cylinder{0.04, 1e-3}, 5e-4).mesh.triangles.size(), 4 * kSides);
  const TriangleMesh mesh = tessellate(Cylinder{0.04, 1.0}, 5e-4).mesh;
  EXPECT_LT(worst_aspect(mesh, 0, mesh.triangles.size() - 2 * kSides), 5.0);  // caps come last
}

TEST(Tessellation, sphereIsInscribedAndClosed) {
  const double radius = 0.1;
  for (const double wanted : {5e-2, 5e-3, 5e-4, 1e-4}) {
    const Tessellation result = tessellate(Sphere{radius}, wanted);
    EXPECT_LE(result.deviation, wanted);
    EXPECT_EQ(test::open_edges(result.mesh), 0U);
    double nearest = radius;
    for (std::size_t t = 0; t < result.mesh.triangles.size(); ++t) {
      Eigen::Vector3d centroid = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        EXPECT_LE(result.mesh.corner(t, k).norm(), radius);
        centroid += result.mesh.corner(t, k) / 3.0;
      }
      nearest = std::min(nearest, centroid.norm());
    }
    EXPECT_GE(result.deviation, radius - nearest);
    EXPECT_LE(result.deviation, (radius - nearest) * 1.3);
  }
}

TEST(Tessellation, sphereStopsAtFiveSubdivisions) {
  EXPECT_EQ(tessellate(Sphere{1.0}, 0.0).mesh.triangles.size(), 20U * 1024);
  EXPECT_EQ(tessellate(Sphere{1.0}, 1.0).mesh.triangles.size(), 20U);
  EXPECT_EQ(test::icosphere(1.0, 3).triangles.size(), 20U * 64);
}

// The meshes that other tests rely on.
TEST(TestMeshes, haveTheVolumeAndHolesTheySay) {
  EXPECT_EQ(test::open_edges(test::torus(0.2, 0.05, 48, 24)), 0U);
  EXPECT_NEAR(test::signed_volume(test::torus(0.2, 0.05, 200, 100)),
              2.0 * kPi * kPi * 0.2 * 0.05 * 0.05, 1e-5);
  EXPECT_EQ(test::open_edges(test::l_shape(0.3, 0.1)), 0U);
  EXPECT_NEAR(test::signed_volume(test::l_shape(0.3, 0.1)), 0.005, 1e-12);
  EXPECT_EQ(test::open_edges(test::open_box({1, 1, 1})), 4U);
  EXPECT_EQ(test::open_edges(test::sheet(1.0)), 4U);
  EXPECT_EQ(test::open_edges(test::thin_plate(1.0, 0.001)), 0U);
  EXPECT_NEAR(test::surface_area(test::sheet(0.5)), 0.25, 1e-15);
}

}  // namespace
}  // namespace ist
