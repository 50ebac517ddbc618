// Queries near the link.

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/meshes.h"
#include "support/oracle.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/trial.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;

const std::vector<Shape>& shapes() {
  static const std::vector<Shape> kShapes = {
      Box{{0.2, 0.1, 0.3}},          Cylinder{0.05, 0.25},    test::l_shape(0.2, 0.05),
      test::torus(0.1, 0.03, 12, 6), test::icosphere(0.1, 2), test::open_box({0.15, 0.1, 0.2})};
  return kShapes;
}

// Points whose signed distance to the link at rest is from `lowest` to `highest` [m].
std::vector<Point> points_about(const LinkModel& link, double lowest, double highest, int count,
                                test::Rng* rng) {
  std::vector<Point> points;
  for (int i = 0; i < count; ++i) {
    const Point p = link.tree.center() + test::random_vector(rng, 1.2 * link.tree.radius());
    const SignedDistance from = link.solid.signed_distance(p);
    points.push_back(from.witness + test::uniform(rng, lowest, highest) * from.normal);
  }
  return points;
}

Eigen::Isometry3d small_motion(double step, test::Rng* rng) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = test::random_vector(rng, step);
  X.rotate(Eigen::AngleAxisd(test::uniform(rng, 0, 5.0 * step),
                             test::random_vector(rng, 1.0).normalized()));
  return X;
}

// The answers on motions that touch, leave and enter, with clouds that come and go: bounds that are
// kept too long, or for another cloud, would be above the truth.
TEST(NearSurface, HoldsOnMotionsNearTheSurface) {
  const test::Trial trial(shapes(), 0.005);
  test::Rng rng(171);
  int contacts = 0, near = 0;
  for (int run = 0; run < test::scaled(60); ++run) {
    const auto l = static_cast<std::size_t>(run) % trial.model().links.size();
    SCOPED_TRACE(trial.model().links[l].name + ", run " + std::to_string(run));
    const double height = run % 3 == 0 ? 0.002 : 0.02;
    const double lowest = run % 2 == 0 ? -height : 0.3 * height;
    std::vector<std::vector<Point>> points;
    std::vector<CloudSnapshot> clouds(2);
    for (CloudSnapshot& cloud : clouds) {
      points.push_back(points_about(trial.model().links[l], lowest, height, 300, &rng));
      cloud = test::make_snapshot(points.back());
    }
    QueryConfig config;
    config.tolerance = run % 4 == 0 ? 0.0 : std::pow(10.0, test::uniform(&rng, -4, -2));
    ProximityQuery query(trial.shared_model(), config);
    LinkProximity result;
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = test::random_vector(&rng, 0.2 * height);
    const double step = std::pow(10.0, test::uniform(&rng, -5, -2));
    std::size_t c = 0;
    for (int i = 0; i < 40; ++i) {
      X_FL = small_motion(i % 13 == 12 ? 20.0 * step : step, &rng) * X_FL;
      if (i % 10 == 9) c = 1 - c;
      ASSERT_TRUE(query.run_link(l, X_FL, {&clouds[c]}, &result));
      const test::Truth truth = test::truth_of(trial.link(l), X_FL, points[c], clouds[c]);
      test::expect_truth(result, truth, config, X_FL);
      ASSERT_FALSE(testing::Test::HasFailure()) << "step " << i;
      contacts += truth.stored < 0.0 ? 1 : 0;
      near += truth.stored > 0.0 && truth.stored < 0.01 ? 1 : 0;
    }
  }
  EXPECT_GT(contacts, test::scaled(500));
  EXPECT_GT(near, test::scaled(200));
}

// A point of the surface: of a face, an edge, or a corner.
Point surface_point(const TriangleMesh& mesh, test::Rng* rng) {
  const std::size_t t = (*rng)() % mesh.triangles.size(), kind = (*rng)() % 4;
  const double a = kind == 0 ? 1.0 : test::uniform(rng, 0, 1);
  const double b = kind == 0 ? 0.0 : kind == 1 ? 1.0 - a : test::uniform(rng, 0, 1.0 - a);
  return a * mesh.corner(t, 0) + b * mesh.corner(t, 1) + (1.0 - a - b) * mesh.corner(t, 2);
}

// Float moves the corners of a mesh of 10 m by half a micrometre: up to 1 um from the surface its
// winding number told the wrong side.
TEST(NearSurface, TheSideIsThatOfDoublePrecisionHoweverLargeTheMesh) {
  test::Rng rng(173);
  int inside = 0, outside = 0;
  for (const double size : {1.0, 3.0, 10.0}) {
    for (int m = 0; m < 12; ++m) {
      TriangleMesh mesh = m % 3 == 0   ? test::box({1.0, 0.6, 0.8})
                          : m % 3 == 1 ? test::random_lump(&rng)
                                       : test::torus(0.4, 0.1, 16, 8);
      const double scale = size / test::bounds(mesh).sizes().maxCoeff();
      for (Point& v : mesh.vertices) v *= scale;
      mesh = test::moved(mesh, test::random_pose(&rng, m % 2 == 0 ? 0.0 : 10.0));
      const auto model = test::model_of({test::one(mesh)}, 0.2 * size);
      const Solid& solid = model->links[0].solid;
      ProximityQuery query(model, QueryConfig());
      for (const double height : {1e-12, 1e-10, 1e-9, 1e-8, 5e-8, 2e-7, 1e-6}) {
        for (int i = 0; i < test::scaled(40); ++i) {
          const Point p =
              surface_point(mesh, &rng) + height * test::random_vector(&rng, 1.0).normalized();
          const double truth = test::oracle_signed_distance(mesh, p);
          if (std::abs(truth) < 0.3 * height) continue;
          ASSERT_EQ(solid.is_inside(p), truth < 0.0)
              << height << " m from a mesh of " << size << " m, " << m;
          (truth < 0.0 ? inside : outside) += 1;
          // The same through a query: the stored point is asked about.
          const CloudSnapshot cloud = test::make_snapshot({p}, p);
          LinkProximity result;
          ASSERT_TRUE(query.run_link(0, Eigen::Isometry3d::Identity(), {&cloud}, &result));
          ASSERT_EQ(result.state == LinkState::kContact, truth < 0.0);
        }
      }
    }
  }
  EXPECT_GT(inside, test::scaled(2500));
  EXPECT_GT(outside, test::scaled(2500));
}

}  // namespace
}  // namespace ist
