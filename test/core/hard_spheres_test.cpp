// Inner Sphere Trees and queries of packings made by hand: equal and concentric spheres, and radii
// from 1e-6 to 1e3 m.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "support/sanitizers.h"
#include "support/trial.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;

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

void expect_tree(const SphereLink& link, test::Rng* rng, int points) {
  SphereLink covered = link;
  for (InnerSphere& sphere : covered.spheres) sphere.cover_radius += 0.1 * sphere.radius;
  const InnerSphereTree tree(covered.packing());
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
