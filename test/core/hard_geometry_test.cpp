// Exact distances of slivers, needles and triangles without area, against brute force.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "internal/geometry/closest_point_on_triangle.h"
#include "internal/geometry/triangle_bvh.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/trial.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;

// A degenerate triangle: two long sides and a short one, in any order, down to a line or a point.
std::array<Point, 3> random_sliver(test::Rng* rng) {
  const Point a = test::random_vector(rng, 0.5), along = test::random_vector(rng, 0.5);
  const double width = std::pow(10.0, test::uniform(rng, -18, 0));
  const double where = test::uniform(rng, -1, 2);
  Point b = a + along, c = a + where * along + test::random_vector(rng, width);
  switch (static_cast<int>(test::uniform(rng, 0, 8))) {
    case 0:
      c = a + where * along;
      break;  // a line up to rounding
    case 1:
      c = b;
      break;
    case 2:
      b = c = a;
      break;
    default:
      break;
  }
  std::array<Point, 3> triangle = {a, b, c};
  std::rotate(triangle.begin(), triangle.begin() + static_cast<int>(test::uniform(rng, 0, 3)),
              triangle.end());
  return triangle;
}

TEST(HardGeometry, ClosestPointOnSlivers) {
  test::Rng rng(31);
  for (int i = 0; i < test::scaled(400000); ++i) {
    const auto [a, b, c] = random_sliver(&rng);
    const double u = test::uniform(&rng, 0, 1), v = test::uniform(&rng, 0, 1 - u);
    const double off = std::pow(10.0, test::uniform(&rng, -12, 0));
    const Point p = (1 - u - v) * a + u * b + v * c + test::random_vector(&rng, off);
    const Point q = closest_point_on_triangle(p, a, b, c);
    ASSERT_TRUE(q.allFinite());
    ASSERT_NEAR((q - p).norm(), test::oracle_triangle(p, a, b, c), 1e-8)
        << i << ": " << a.transpose() << ", " << b.transpose() << ", " << c.transpose();
    ASSERT_LT(test::oracle_triangle(q, a, b, c), 1e-8) << i << ": the witness is off the triangle";
  }
}

std::vector<TriangleMesh> thin_meshes() {
  return {test::needle(0.3, 1e-3),
          test::needle(0.3, 1e-5),
          test::needle(3.0, 1e-4),
          test::box({1e-4, 1e-4, 0.3}),
          test::thin_plate(0.2, 1e-5),
          test::sliver_plate(0.3, 0.01, 1e-3, 50),
          test::sliver_plate(1.0, 0.01, 1e-5, 100),
          test::sliver_plate(1.0, 0.01, 1e-3, 1000),
          test::chazelle(4, 0.0005, 0.2)};
}

// A point at a distance of 1e-8 to 0.1 m from a triangle of the mesh.
Point near_surface(const TriangleMesh& mesh, test::Rng* rng) {
  const auto t = static_cast<std::size_t>(test::uniform(rng, 0, 1) *
                                          static_cast<double>(mesh.triangles.size()));
  const double u = test::uniform(rng, 0, 1), v = test::uniform(rng, 0, 1 - u);
  return (1 - u - v) * mesh.corner(t, 0) + u * mesh.corner(t, 1) + v * mesh.corner(t, 2) +
         test::random_vector(rng, std::pow(10.0, test::uniform(rng, -8, -1)));
}

// Regression: the solid angle of a sliver, at a distance below its width, is a small difference
// of large float products. Its sign was random, so that points up to 4e-6 m outside a needle 0.3 m
// long and 1e-5 m thick counted as inside.
TEST(HardGeometry, InsideOfThinMeshes) {
  test::Rng rng(33);
  for (const TriangleMesh& mesh : thin_meshes()) {
    const TriangleBvh bvh(mesh);
    // Points within the rounding error of float coordinates are skipped.
    const double rounding = 2e-7 * test::bounds(mesh).sizes().norm();
    const int count = test::scaled(mesh.triangles.size() > 1000 ? 1000 : 5000);
    for (int i = 0; i < count; ++i) {
      const Point p = near_surface(mesh, &rng);
      if (test::oracle_distance(mesh, p) < rounding) continue;
      const double truth = test::oracle_winding(mesh, p);
      ASSERT_EQ(bvh.is_inside(p), truth > 0.5)
          << p.transpose() << " at " << test::oracle_distance(mesh, p);
      ASSERT_NEAR(bvh.winding_number(p), truth, 0.01) << p.transpose();
      ASSERT_NEAR(bvh.quick_winding_number(p), truth, TriangleBvh::kQuickWindingError)
          << p.transpose();
    }
  }
}

// Inner Sphere Trees and queries of packings made by hand: equal and concentric spheres, and radii
// from 1e-6 to 1e3 m.

// A link that is a union of spheres, packed with exactly these spheres.
struct SphereLink {
  std::vector<InnerSphere> spheres;

  Packing packing() const {
    Packing packing;
    packing.spheres = spheres;
    packing.certificate.reached = true;
    return packing;
  }

  LinkGeometry geometry() const {
    LinkGeometry link;
    for (const InnerSphere& sphere : spheres) {
      GeometryElement element{Sphere{sphere.radius}, Eigen::Isometry3d::Identity(), "test"};
      element.X_LE.translation() = sphere.center;
      link.push_back(element);
    }
    return link;
  }

  std::shared_ptr<const RobotModel> model() const {
    auto robot = std::make_shared<RobotModel>();
    LinkModel link;
    link.name = "spheres";
    link.packing = packing();
    link.tree = InnerSphereTree(link.packing);
    link.solid = Solid(geometry());
    robot->links.push_back(std::move(link));
    return robot;
  }

  double extent() const {
    double extent = 0.0;
    for (const InnerSphere& sphere : spheres)
      extent = std::max(extent, sphere.center.norm() + sphere.radius);
    return extent;
  }
};

// The distance to the nearest inner sphere, or to the nearest cover sphere.
double nearest_sphere(const std::vector<InnerSphere>& spheres, const Point& p, bool cover) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const InnerSphere& sphere : spheres) {
    nearest = std::min(nearest,
                       (p - sphere.center).norm() - (cover ? sphere.cover_radius : sphere.radius));
  }
  return nearest;
}

SphereLink random_spheres(test::Rng* rng, int count, double smallest, double largest) {
  SphereLink link;
  for (int i = 0; i < count; ++i) {
    const double low = std::log10(smallest), high = std::log10(largest);
    const double radius = std::pow(10.0, test::uniform(rng, low, high));
    const double away = std::pow(10.0, test::uniform(rng, low, high));
    link.spheres.push_back({test::random_vector(rng, 2.0 * away), radius, radius});
  }
  return link;
}

Point random_point(test::Rng* rng, const SphereLink& link) {
  const auto i =
      static_cast<std::size_t>(test::uniform(rng, 0, 1) * static_cast<double>(link.spheres.size()));
  const InnerSphere& sphere = link.spheres[i];
  const double distance = sphere.radius * std::pow(10.0, test::uniform(rng, -3, 1));
  return sphere.center +
         test::random_vector(rng, 1.0).normalized() *
             (test::uniform(rng, 0, 1) < 0.5 ? distance : sphere.radius + 0.1 * distance);
}

// A sphere of the tree is one that was given, in float: its inner sphere lies in that one, and its
// cover sphere holds it.
void expect_rounded(const InnerSphereTree& tree, const InnerSphere& given) {
  bool is_found = false;
  for (const SphereLeaf& leaf : tree.leaves()) {
    for (int k = 0; k < leaf.count && !is_found; ++k) {
      const Point center(leaf.x[k], leaf.y[k], leaf.z[k]);
      const double moved = (center - given.center).norm();
      is_found = static_cast<double>(leaf.inner_radius[k]) <= given.radius - moved &&
                 static_cast<double>(leaf.cover_radius[k]) >= given.cover_radius + moved &&
                 moved <= 1e-6 * given.center.norm();
    }
  }
  EXPECT_TRUE(is_found) << given.center.transpose() << ", radius " << given.radius;
}

void expect_tree(const SphereLink& link, test::Rng* rng, int points) {
  SphereLink covered = link;
  for (InnerSphere& sphere : covered.spheres) sphere.cover_radius += 0.1 * sphere.radius;
  const InnerSphereTree tree(covered.packing());
  for (const InnerSphere& sphere : covered.spheres) expect_rounded(tree, sphere);
  for (int i = 0; i < points; ++i) {
    const Point p = random_point(rng, link);
    const double rounding = 4e-6 * (link.extent() + p.norm());
    const double inner = nearest_sphere(covered.spheres, p, false);
    const double cover = nearest_sphere(covered.spheres, p, true);
    EXPECT_GE(tree.inner_distance(p), inner - 1e-12 * link.extent());
    EXPECT_LE(tree.inner_distance(p), inner + rounding);
    EXPECT_LE(tree.cover_distance(p), cover) << "must be a lower bound";
    EXPECT_GE(tree.cover_distance(p), cover - rounding);
    const double stop = cover + test::uniform(rng, -1, 1) * std::abs(cover);
    const double stopped = tree.cover_distance(p, stop);
    EXPECT_EQ(stopped > stop, tree.cover_distance(p) > stop)
        << "stopping early must not change the comparison";
    EXPECT_FALSE(tree.cover_distance_exceeds(p, stop) && cover <= stop);
    EXPECT_TRUE(tree.cover_distance_exceeds(p, stop) || cover - rounding <= stop);
  }
}

void expect_query(const SphereLink& link, test::Rng* rng, int clouds) {
  test::Trial trial(link.model(), {link.geometry()}, 1e-12 * link.extent() + 1e-15);
  trial.size = std::max(1.0, link.extent());
  trial.max_distance = 10.0 * trial.size;
  for (int i = 0; i < clouds; ++i) {
    std::vector<Point> points;
    for (int k = 0; k < 1 + i % 7; ++k) points.push_back(random_point(rng, link));
    trial.expect(points);
    trial.expect({link.spheres[0].center});
  }
}

TEST(HardSpheres, Concentric) {
  test::Rng rng(51);
  SphereLink link;
  for (int i = 1; i <= 40; ++i) link.spheres.push_back({{0.1, -0.2, 0.3}, 0.01 * i, 0.01 * i});
  std::reverse(link.spheres.begin(), link.spheres.end());
  expect_tree(link, &rng, test::scaled(2000));
  expect_query(link, &rng, test::scaled(200));
}

TEST(HardSpheres, Equal) {
  test::Rng rng(52);
  SphereLink link;
  link.spheres.assign(300, {{0.1, -0.2, 0.3}, 0.05, 0.05});
  expect_tree(link, &rng, test::scaled(2000));
  expect_query(link, &rng, test::scaled(100));
  link.spheres.assign(300, {{0.1, -0.2, 0.3}, 0.0, 0.0});
  link.spheres.push_back({{0.1, -0.2, 0.3}, 0.01, 0.01});
  expect_tree(link, &rng, test::scaled(500));
}

TEST(HardSpheres, EveryScale) {
  test::Rng rng(53);
  for (const double scale : {1e-6, 1e-4, 1e-2, 1.0, 1e2, 1e3}) {
    SCOPED_TRACE(::testing::Message() << "radii about " << scale << " m");
    const SphereLink link = random_spheres(&rng, 60, 0.1 * scale, scale);
    expect_tree(link, &rng, test::scaled(2000));
    expect_query(link, &rng, test::scaled(200));
  }
}

TEST(HardSpheres, AllScalesInOneTree) {
  test::Rng rng(54);
  for (int i = 0; i < 10; ++i) {
    const SphereLink link = random_spheres(&rng, 100, 1e-6, i < 5 ? 1.0 : 1e3);
    expect_tree(link, &rng, test::scaled(1000));
    expect_query(link, &rng, test::scaled(100));
  }
}

}  // namespace
}  // namespace ist
