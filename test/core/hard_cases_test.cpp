// Points and shapes for which distance code often fails, against brute force: state, bounds and
// witnesses.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "support/hard_shapes.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;
using Points = std::vector<Eigen::Vector3d>;

// A box, a cylinder and a sphere, as primitives and as meshes, and a concave mesh.
const test::Trial& common_links() {
  static const test::Trial trial({Box{{0.2, 0.1, 0.3}}, Cylinder{0.08, 0.25}, Sphere{0.1},
                                  test::box({0.2, 0.1, 0.3}), test::icosphere(0.1, 2),
                                  test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 24, 12)});
  return trial;
}

// Each point alone, and all at once.
void expect_each(const test::Trial& trial, const Points& points) {
  const std::size_t stride = points.size() > test::kStride ? test::kStride : 1;
  for (std::size_t i = 0; i < points.size(); i += stride) {
    SCOPED_TRACE(::testing::Message() << "point " << points[i].transpose());
    trial.expect({points[i]});
  }
  trial.expect(points);
}

// Points on every vertex, edge middle and face middle of a mesh.
Points features(const TriangleMesh& mesh) {
  Points points;
  for (std::size_t t = 0; t < mesh.triangles.size(); t += 1 + mesh.triangles.size() / 40) {
    const Point a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2);
    for (const Point& p : {a, Point(0.5 * (a + b)), Point((a + b + c) / 3.0)}) points.push_back(p);
  }
  return points;
}

TEST(HardCases, OnSurfaceEdgeAndVertex) {
  const test::Trial& trial = common_links();
  for (std::size_t i = 0; i < trial.model().links.size(); ++i) {
    if (const auto* mesh = std::get_if<TriangleMesh>(&trial.link(i)[0].shape)) {
      expect_each(trial, features(*mesh));
    }
  }
  // Points on the cap, wall and rim of the cylinder, and on the pole and equator of the sphere.
  expect_each(trial, {{0, 0, 0.125},
                      {0.08, 0, 0},
                      {0.08, 0, 0.125},
                      {0, 0.08, -0.125},
                      {0, 0, 0.1},
                      {0.1, 0, 0},
                      {0, -0.1, 0}});
}

TEST(HardCases, NextToTheSurface) {
  const test::Trial& trial = common_links();
  for (const double off : {1e-4, 1e-6, 1e-8, 1e-10, 1e-13, 1e-16}) {
    expect_each(trial, {{0.1 + off, 0, 0},
                        {0.1 - off, 0, 0},
                        {0.1 + off, 0.05 + off, 0},
                        {0.1 + off, 0.05 + off, 0.15 + off},
                        {0.08 + off, 0, 0.125 + off}});
  }
}

TEST(HardCases, AtCentresAndOnTheMedialAxis) {
  const test::Trial& trial = common_links();
  Points points = {{0, 0, 0},
                   {0, 0, 0.05},
                   {0, 0, -0.1},
                   {0.05, 0, 0.1},
                   {0.1, 0, 0},
                   {0, 0.1, 0},
                   {-0.0707, 0.0707, 0},  // the torus's circle
                   {0.025, 0.025, 0.025},
                   {0.1, 0.025, 0.025},
                   {1e-300, 0, 0},
                   {0, 5e-324, 0}};
  for (std::size_t i = 0; i < trial.model().links.size(); ++i) {
    const std::vector<InnerSphere>& spheres = trial.model().links[i].packing.spheres;
    for (std::size_t k = 0; k < spheres.size(); k += 1 + spheres.size() / 6) {
      points.push_back(spheres[k].center);
    }
  }
  expect_each(trial, points);
}

TEST(HardCases, OnePointAndEmptyCloud) {
  expect_each(common_links(), {{0.3, 0.2, 0.1}, {5, 5, 5}, {-0.99, 0, 0}});
  const CloudSnapshot nothing = test::make_snapshot({});
  const std::size_t count = common_links().model().links.size();
  std::vector<LinkProximity> results;
  ProximityQuery query(common_links().shared_model(), {});
  query.run(std::vector<Eigen::Isometry3d>(count, Eigen::Isometry3d::Identity()),
            std::vector<bool>(count, true), {&nothing}, &results);
  for (const LinkProximity& result : results) {
    EXPECT_EQ(result.state, LinkState::kClear);
    EXPECT_EQ(result.lower_bound, 1.0);
  }
}

TEST(HardCases, CollinearAndCoplanar) {
  test::Rng rng(21);
  for (int i = 0; i < test::scaled(200); ++i) {
    const Point middle = test::random_vector(&rng, 0.3), u = test::random_vector(&rng, 0.5),
                v = i % 2 == 0 ? Point::Zero() : test::random_vector(&rng, 0.5);
    Points points;
    for (int k = 0; k < 40; ++k) {
      points.push_back(middle + test::uniform(&rng, -1, 1) * u + test::uniform(&rng, -1, 1) * v);
    }
    common_links().expect(points, test::random_pose(&rng, 0.2));
  }
  // A line along an axis, and a plane in which a face of a link lies.
  Points line, plane;
  for (int i = -20; i <= 20; ++i) {
    line.emplace_back(0.02 * i, 0.0, 0.0);
    for (int k = -5; k <= 5; ++k) plane.emplace_back(0.02 * i, 0.05, 0.03 * k);
  }
  common_links().expect(line);
  common_links().expect(plane);
}

TEST(HardCases, Chazelle) {
  const TriangleMesh mesh = test::chazelle(4, 0.002, 0.2);
  ASSERT_EQ(test::open_edges(mesh), 0U);
  ASSERT_GT(test::signed_volume(mesh), 0.0);
  const test::Trial trial({mesh});
  expect_each(trial, features(mesh));
  test::Rng rng(22);
  const Eigen::AlignedBox3d box = test::bounds(mesh);
  for (int i = 0; i < test::scaled(300); ++i) {
    Points points;
    for (int k = 0; k < 1 + i % 10; ++k) {
      const Point inside =
          box.min() +
          0.5 * (test::random_vector(&rng, 1.0) + Point::Ones()).cwiseProduct(box.sizes());
      points.push_back(i % 2 == 0 ? inside : Point(box.center() + test::random_vector(&rng, 0.3)));
    }
    trial.expect(points);
  }
}

// In thin parts, inner spheres are small and winding numbers change fast.
TEST(HardCases, ThinPlatesAndNeedles) {
  test::Rng rng(23);
  const std::vector<TriangleMesh> meshes = {test::thin_plate(0.2, 1e-3),
                                            test::thin_plate(0.2, 1e-5),
                                            test::box({1e-4, 1e-4, 0.3}),
                                            test::needle(0.3, 1e-3),
                                            test::needle(0.3, 1e-5),
                                            test::sliver_plate(0.3, 0.01, 1e-3, 50),
                                            test::sliver_plate(1.0, 0.01, 1e-5, 100),
                                            test::sheet(0.2)};
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    SCOPED_TRACE("mesh " + std::to_string(m));
    // Sums in float decide on which side of a surface a point is: to 1e-6 of the size at worst.
    const test::Trial trial({meshes[m]}, 0.01, 1e-6);
    expect_each(trial, features(meshes[m]));
    for (int i = 0; i < test::scaled(200); ++i) {
      const auto t = static_cast<std::size_t>(test::uniform(&rng, 0, 1) *
                                              static_cast<double>(meshes[m].triangles.size()));
      const double u = test::uniform(&rng, 0, 1), v = test::uniform(&rng, 0, 1 - u);
      const Point on = (1 - u - v) * meshes[m].corner(t, 0) + u * meshes[m].corner(t, 1) +
                       v * meshes[m].corner(t, 2);
      const double off = std::pow(10.0, test::uniform(&rng, -8, -1));
      trial.expect({on + test::random_vector(&rng, off)});
    }
  }
}

TEST(HardCases, InsideAClosedShellOfPoints) {
  for (const double radius : {0.25, 0.6}) {
    Points shell;
    for (const Point& v : test::icosphere(radius, test::kSanitized ? 2 : 4).vertices)
      shell.push_back(v);
    common_links().expect(shell);
    test::Rng rng(24);
    common_links().expect(shell, test::random_pose(&rng, 0.05));
  }
}

TEST(HardCases, AtTheEdgeOfMaxDistance) {
  test::Trial trial({Sphere{0.1}, Box{{0.2, 0.2, 0.2}}, test::box({0.2, 0.2, 0.2})});
  for (const double max_distance : {0.05, 0.3, 1.0, 4.0}) {
    trial.max_distance = max_distance;
    for (const double off : {-1e-3, -1e-5, -1e-7, 0.0, 1e-7, 1e-5, 1e-3}) {
      SCOPED_TRACE(::testing::Message() << max_distance << " and " << off);
      const Point p(0.1 + max_distance + off, 0, 0);
      const CloudSnapshot cloud = test::make_snapshot({p});
      const double truth = test::stored_points(cloud.index)[0].x() - 0.1;
      for (const double tolerance : {0.0, 0.001}) {
        QueryConfig config;
        config.max_distance = max_distance;
        config.tolerance = tolerance;
        std::vector<LinkProximity> results;
        ProximityQuery(trial.shared_model(), config)
            .run(std::vector<Eigen::Isometry3d>(3, Eigen::Isometry3d::Identity()),
                 {true, true, true}, {&cloud}, &results);
        for (const LinkProximity& result : results) {
          EXPECT_LE(result.lower_bound, std::max(truth, p.x() - 0.1) + 1e-12);
          if (result.state == LinkState::kClear) {
            EXPECT_GE(truth, max_distance);
          } else {
            ASSERT_EQ(result.state, LinkState::kNear);
            EXPECT_NEAR(result.distance, truth, 1e-9);
            // NEAR is allowed outside max_distance only within the rounding error.
            EXPECT_LT(truth, max_distance + 1e-5);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace ist
