// Bounds that only rare scenes need: without them, nothing else in the tests is wrong.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/proximity/self_query.h"
#include "support/link_pair_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist {
namespace {

using Points = std::vector<Eigen::Vector3d>;

LinkProximity answer_of(ProximityQuery* query, const Eigen::Isometry3d& X_FL,
                        const CloudSnapshot& cloud) {
  LinkProximity answer;
  const CloudSnapshot* clouds[] = {&cloud};
  query->run_link(0, X_FL, {clouds, 1}, &answer);
  return answer;
}

// A point a kilometre away has a distance that float knows to 60 um. The bound that is kept while
// the link comes near loses that.
TEST(RareBounds, AKeptBoundOfAFarPointLosesFloatsError) {
  test::Rng rng(161);
  const auto model = test::make_model({Sphere{0.1}}, 0.02);
  QueryConfig config;
  config.tolerance = 0.0;
  for (int i = 0; i < test::scaled(500); ++i) {
    const Eigen::Vector3d direction = test::random_vector(&rng, 1.0).normalized();
    const double far = test::power_of_ten(&rng, 2.0, 3.9);
    const CloudSnapshot cloud = test::make_snapshot({far * direction});
    const Eigen::Vector3d stored = test::stored_points(cloud.index)[0];
    ProximityQuery query(model, config);
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    ASSERT_EQ(answer_of(&query, X_FL, cloud).state, LinkState::kClear);
    const double truth = config.max_distance - 1e-8;
    X_FL.translation() = stored - (truth + 0.1) * direction;
    const LinkProximity answer = answer_of(&query, X_FL, cloud);
    ASSERT_LE(answer.lower_bound, truth + 1e-12 * far) << "case " << i << " at " << far;
  }
}

// Points inside a link, but in none of its spheres, beside many that are outside and nearer to its
// surface: the distance of the surface prunes no box whose side is not known.
TEST(RareBounds, ABoxThatMayBeInsideIsNotPrunedByTheSurface) {
  test::Rng rng(162);
  int contacts = 0;
  for (int i = 0; i < test::scaled(300); ++i) {
    const LinkGeometry link =
        i % 2 == 0 ? test::one(test::l_shape(0.2, 0.04)) : test::one(test::random_lump(&rng));
    const auto model = test::model_of({link}, test::uniform(&rng, 0.005, 0.05));
    const auto& mesh = std::get<TriangleMesh>(link[0].shape);
    const auto point_at = [&](double height) {
      const std::size_t t = test::below(&rng, mesh.triangles.size());
      const double u = test::uniform(&rng, 0.2, 0.8), v = test::uniform(&rng, 0.0, 1.0 - u);
      const Eigen::Vector3d a = mesh.corner(t, 0), b = mesh.corner(t, 1), c = mesh.corner(t, 2);
      return Eigen::Vector3d(a + u * (b - a) + v * (c - a) +
                             height * (b - a).cross(c - a).normalized());
    };
    Points points;
    const double near = test::power_of_ten(&rng, -4.0, -3.0);
    for (int k = 0; k < 400; ++k) points.push_back(point_at(near));
    const Eigen::Vector3d inside = point_at(-test::uniform(&rng, 0.002, 0.01));
    for (int k = 0; k < 20; ++k) points.push_back(inside + test::random_vector(&rng, 2e-4));
    const CloudSnapshot cloud = test::make_snapshot(points);
    double truth = std::numeric_limits<double>::infinity();
    for (const Eigen::Vector3d& p : test::stored_points(cloud.index)) {
      truth = std::min(truth, test::oracle_signed_distance(link, p));
    }
    if (!(std::abs(truth) > 1e-5)) continue;
    QueryConfig config;
    config.tolerance = 0.0;
    ProximityQuery query(model, config);
    const LinkProximity answer = answer_of(&query, Eigen::Isometry3d::Identity(), cloud);
    ASSERT_EQ(answer.state, truth < 0.0 ? LinkState::kContact : LinkState::kNear) << i;
    ASSERT_NEAR(answer.distance, truth, 1e-6) << i;
    contacts += truth < 0.0 ? 1 : 0;
  }
  EXPECT_GT(contacts, test::scaled(50));
}

/// The point of the link's box that is inside and farthest from its cover spheres.
Eigen::Vector3d least_covered(const LinkModel& link, const LinkGeometry& geometry, test::Rng* rng,
                              double* margin) {
  *margin = -std::numeric_limits<double>::infinity();
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  for (int i = 0; i < 4000; ++i) {
    const Eigen::Vector3d p = test::random_vector(rng, 0.2);
    if (!(test::oracle_signed_distance(geometry, p) < 0.0)) continue;
    const double outer = link.tree.cover_distance(p, 1.0);
    if (!(outer > *margin)) continue;
    *margin = outer;
    best = p;
  }
  return best;
}

// Cover spheres cover a link's surface, and its interior but for the interior gap. The deepest
// point of a link in a larger one may be there.
TEST(RareBounds, TheDeepestPointOfAPairMayBeInNoSphere) {
  test::Rng rng(163);
  int cases = 0;
  for (int i = 0; i < test::scaled(60); ++i) {
    const LinkGeometry outer = test::one(test::random_lump(&rng));
    const double radius = 0.3;
    const std::vector<LinkGeometry> links = {outer, test::one(Sphere{radius})};
    const auto model = test::model_of(links, test::uniform(&rng, 0.005, 0.05));
    double margin;
    const Eigen::Vector3d p = least_covered(model->links[0], outer, &rng, &margin);
    if (!(margin > 1e-4)) continue;
    ++cases;
    QueryConfig config;
    SelfQuery query(model, {{0, 1}}, config);
    std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
    X_FL[1].translation() = p;  // the centre, which is the deepest point of the sphere
    std::vector<PairProximity> results;
    query.run(X_FL, {true, true}, &results);
    ASSERT_LE(results[0].lower_bound, -radius + 1e-9) << "case " << i << ", margin " << margin;
  }
  EXPECT_GT(cases, test::kSanitized ? 0 : 10);
}

/// A square with bumps of this height, of n x n cells.
TriangleMesh bumpy_square(double side, double height, std::uint32_t n, test::Rng* rng) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i <= n; ++i) {
    for (std::uint32_t k = 0; k <= n; ++k) {
      mesh.vertices.emplace_back(side * (i / double(n) - 0.5), side * (k / double(n) - 0.5),
                                 test::uniform(rng, 0.0, height));
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t k = 0; k < n; ++k) {
      const std::uint32_t a = i * (n + 1) + k, b = a + n + 1;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

// More pairs are near than the front holds, so that the search goes depth first. What it prunes
// there, because it is near enough to the distance, has a bound all the same.
TEST(RareBounds, WhatIsPrunedDepthFirstHasABound) {
  test::Rng rng(164);
  for (int i = 0; i < test::scaled(6); ++i) {
    const double height = 0.002;
    const std::vector<LinkGeometry> links = {test::one(bumpy_square(0.2, height, 24, &rng)),
                                             test::one(bumpy_square(0.2, height, 24, &rng))};
    const auto model = test::model_of(links, 0.1);
    const test::TriangleGroups first(test::triangles_of(links[0])),
        second(test::triangles_of(links[1]));
    std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
    X_FL[1].translation().z() = 0.03;
    X_FL[1].linear() = Eigen::AngleAxisd(0.003, Eigen::Vector3d::UnitX()).matrix();
    const double truth = first.distance(second, X_FL[1]);
    for (const double tolerance : {0.0003, 0.001, 0.002}) {
      QueryConfig config;
      config.tolerance = tolerance;
      SelfQuery query(model, {{0, 1}}, config);
      std::vector<PairProximity> results;
      query.run(X_FL, {true, true}, &results);
      ASSERT_LE(results[0].lower_bound, truth + 1e-12)
          << "case " << i << ", tolerance " << tolerance;
      ASSERT_GE(results[0].distance, truth - 1e-12);
      ASSERT_LE(results[0].distance, truth + tolerance + 1e-12);
    }
  }
}

}  // namespace
}  // namespace ist
