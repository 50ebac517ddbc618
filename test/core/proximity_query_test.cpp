#include "ist_proximity/proximity/proximity_query.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/proximity/deadline.h"
#include "support/distance_fields.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<TriangleMesh> link_meshes() {
  return {test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 24, 12), test::box({0.05, 0.1, 0.2}),
          test::thin_plate(0.1, 0.001), test::icosphere(0.08, 2)};
}

std::vector<Shape> shapes_of(const std::vector<TriangleMesh>& meshes) {
  return {meshes.begin(), meshes.end()};
}

std::vector<Eigen::Vector3d> random_cloud(test::Rng* rng, int kind, int count) {
  std::vector<Eigen::Vector3d> points;
  const Eigen::Vector3d middle = test::random_vector(rng, 0.4);
  const Eigen::Vector3d a = test::random_vector(rng, 0.5), b = test::random_vector(rng, 0.5);
  for (int i = 0; i < count; ++i) {
    const double s = test::uniform(rng, -1, 1), t = test::uniform(rng, -1, 1);
    // A volume, a plane, a line, a cluster.
    points.push_back(kind % 4 == 0   ? test::random_vector(rng, 0.6)
                     : kind % 4 == 1 ? Eigen::Vector3d(middle + s * a + t * b)
                     : kind % 4 == 2 ? Eigen::Vector3d(middle + s * a)
                                     : middle + test::random_vector(rng, 0.05));
  }
  return points;
}

void expect_consistent(const LinkProximity& result, const Eigen::Isometry3d& X_FL) {
  if (result.state < LinkState::kNear) return;
  test::expect_witness(result, X_FL);
  EXPECT_LE(result.lower_bound, result.distance);
}

class AgainstOracle : public ::testing::TestWithParam<double> {};

// A square grid of points about the plane z = 0, each at most `noise` [m] above or below it.
std::vector<Eigen::Vector3d> flat_obstacle(test::Rng* rng, double spacing, double noise) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 400; ++i) {
    const Eigen::Vector3d grid(i % 20 - 10, i / 20 - 10, 0);
    points.emplace_back(spacing * grid +
                        test::uniform(rng, -1, 1) * (Eigen::Vector3d::UnitZ() * noise));
  }
  return points;
}

// Raises a pose X of a mesh until its lowest vertex is at `height` [m].
void raise_to(double height, const TriangleMesh& mesh, Eigen::Isometry3d* X) {
  double lowest = kInfinity;
  for (const Eigen::Vector3d& v : mesh.vertices) lowest = std::min(lowest, (*X * v).z());
  X->translation().z() += height - lowest;
}

// Many points of a plane are about equally near to a link, and the farther it is the more of them.
// Through the hole of the open box, an inner sphere may be nearer to a point than the mesh is.
TEST_P(AgainstOracle, FlatObstaclesNearAndFar) {
  const double tolerance = GetParam();
  test::Rng rng(12);
  std::vector<TriangleMesh> meshes = link_meshes();
  meshes.push_back(test::open_box({0.1, 0.1, 0.2}));
  const auto model = test::make_model(shapes_of(meshes), 0.005);
  QueryConfig config;
  config.tolerance = tolerance;
  config.max_distance = 10.0;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  const std::vector<bool> known(meshes.size(), true);
  // A wide tolerance hides no point that is only just inside.
  for (const double height : {-0.02, -0.003, -0.0005, 0.003, 0.03, 0.3, 3.0}) {
    for (int scene = 0; scene < 6; scene += test::kSanitized ? 3 : 1) {
      const double spacing = test::uniform(&rng, 0.003, 0.01);
      const CloudSnapshot snapshot =
          test::make_snapshot(flat_obstacle(&rng, spacing, scene % 3 == 0 ? 0.001 : 0.0));
      std::vector<Eigen::Isometry3d> X_FL;
      for (const TriangleMesh& mesh : meshes) {
        Eigen::Isometry3d X = test::random_pose(&rng, 0.02);
        if (scene % 4 == 0) X.linear().setIdentity();  // flat on flat
        raise_to(height, mesh, &X);
        X_FL.push_back(X);
      }
      ASSERT_TRUE(query.run(X_FL, known, {&snapshot}, &results));
      for (std::size_t i = 0; i < meshes.size(); ++i) {
        const double truth = test::oracle_minimum(test::one(meshes[i]), X_FL[i],
                                                  test::stored_points(snapshot.index));
        expect_consistent(results[i], X_FL[i]);
        ASSERT_EQ(results[i].state, truth < 0.0 ? LinkState::kContact : LinkState::kNear);
        ASSERT_LE(results[i].lower_bound, truth);
        ASSERT_GE(results[i].distance, truth - 1e-9);
        ASSERT_LE(results[i].distance - results[i].lower_bound, tolerance + 3e-5);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Tolerances, AgainstOracle, ::testing::Values(0.0, 0.001, 0.02));

TEST(ProximityQuery, SeveralCloudsAreOneObstacle) {
  test::Rng rng(13);
  const auto model = test::make_model({Sphere{0.1}, Box{{0.1, 0.1, 0.1}}}, 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  const CloudSnapshot far = test::make_snapshot({{0.9, 0, 0}}),
                      near = test::make_snapshot({{0, 0.5, 0}}), nothing = test::make_snapshot({});
  const std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
  std::vector<LinkProximity> results;
  query.run(X_FL, {true, true}, {&far, &nothing, &near}, &results);
  EXPECT_NEAR(results[0].distance, 0.4, 1e-6);
  EXPECT_NEAR(results[1].distance, 0.45, 1e-6);
  EXPECT_EQ(results[0].source, 2);
  query.run(X_FL, {true, true}, {&far}, &results);
  EXPECT_NEAR(results[0].distance, 0.8, 1e-6) << "the nearest cloud is no longer given";
  query.run(X_FL, {true, true}, {&nothing}, &results);
  EXPECT_EQ(results[0].state, LinkState::kClear);
  EXPECT_EQ(results[0].lower_bound, config.max_distance);
}

TEST(ProximityQuery, LinksWithoutPoseGeometryOrCloudAreUnknown) {
  const auto model = test::make_model({Sphere{0.1}, Sphere{0.1}}, 0.005);
  model->links[1].error = "mesh is missing";
  ProximityQuery query(model, {});
  const CloudSnapshot snapshot = test::make_snapshot({{0.3, 0, 0}});
  const std::vector<Eigen::Isometry3d> X_FL(2, Eigen::Isometry3d::Identity());
  std::vector<LinkProximity> results;
  const auto expect_unknown = [](const LinkProximity& result) {
    EXPECT_EQ(result.state, LinkState::kUnknown);
    EXPECT_TRUE(std::isnan(result.distance));
    EXPECT_EQ(result.lower_bound, -kInfinity);
    EXPECT_TRUE(result.p_FCl.array().isNaN().all() && result.direction.array().isNaN().all());
  };
  query.run(X_FL, {true, true}, {&snapshot}, &results);
  EXPECT_EQ(results[0].state, LinkState::kNear);
  expect_unknown(results[1]);
  query.run(X_FL, {false, true}, {&snapshot}, &results);
  expect_unknown(results[0]);
  query.run(X_FL, {true, true}, {}, &results);
  expect_unknown(results[0]);
}

TEST(ProximityQuery, MarginLowersTheBoundAndWidensTheSearch) {
  const auto model = test::make_model({Sphere{0.1}}, 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  config.margin = 0.05;
  ProximityQuery query(model, config);
  const auto answer = [&](double x) {
    const CloudSnapshot cloud = test::make_snapshot({{x, 0, 0}});
    std::vector<LinkProximity> results;
    query.run(std::vector{Eigen::Isometry3d::Identity()}, {true}, {&cloud}, &results);
    return results[0];
  };
  EXPECT_NEAR(answer(0.5).distance, 0.4, 1e-6);
  EXPECT_NEAR(answer(0.5).lower_bound, 0.35, 1e-5);
  EXPECT_EQ(answer(1.12).state, LinkState::kNear) << "1.02 m less the margin is not proven 1 m";
  EXPECT_EQ(answer(1.2).state, LinkState::kClear);
}

struct Answers {
  int all = 0, contacts = 0;
};

// What holds of a query's answers wherever it stopped. @param what  of the query
void expect_bounds(const std::vector<LinkProximity>& results, const std::vector<Solid>& solids,
                   const std::vector<Eigen::Isometry3d>& X_FL, const std::vector<double>& truth,
                   const std::string& what, Answers* answers) {
  for (std::size_t k = 0; k < results.size(); ++k) {
    const LinkProximity& result = results[k];
    ASSERT_LE(result.lower_bound, truth[k] + 1e-9) << what << ", link " << k;
    if (result.state < LinkState::kNear) continue;
    ++answers->all;
    answers->contacts += result.state == LinkState::kContact ? 1 : 0;
    expect_consistent(result, X_FL[k]);
    ASSERT_GE(result.distance, truth[k] - 1e-7) << what << ", link " << k;
    const double exact = solids[k].signed_distance(X_FL[k].inverse() * result.p_FCo).distance;
    ASSERT_NEAR(result.distance, exact, 1e-7) << what << ", link " << k;
  }
}

// A query may stop at any of its steps: among two clouds and points inside, with and without
// fields. Where the answer has a point, its distance is that point's, with its side.
TEST(ProximityQuery, BoundsHoldWhereverAQueryStops) {
  test::Rng rng(143);
  std::vector<TriangleMesh> meshes = link_meshes();
  meshes.push_back(test::open_box({0.1, 0.1, 0.15}));
  const std::shared_ptr<const RobotModel> packed = test::make_model(shapes_of(meshes), 0.005);
  const auto with_fields = test::with_fields(packed, 2);
  std::vector<Solid> solids;
  for (const LinkModel& link : packed->links) solids.push_back(link.solid);
  const std::vector<bool> known(meshes.size(), true);
  int stopped = 0;
  Answers answers;
  for (int scene = 0; scene < test::scaled(60); ++scene) {
    std::vector<Eigen::Isometry3d> X_FL(meshes.size());
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.3);
    std::vector<Eigen::Vector3d> points_F = random_cloud(&rng, scene, 400);
    const Eigen::Vector3d inside = X_FL[static_cast<std::size_t>(scene) % 6].translation();
    for (int i = 0; i < 100; ++i) points_F.push_back(inside + test::random_vector(&rng, 0.05));
    const CloudSnapshot first = test::make_snapshot(random_cloud(&rng, scene + 1, 400)),
                        second = test::make_snapshot(points_F);
    std::vector<double> truth;
    for (std::size_t k = 0; k < meshes.size(); ++k) {
      const LinkGeometry link = test::one(meshes[k]);
      truth.push_back(
          std::min(test::oracle_minimum(link, X_FL[k], test::stored_points(first.index)),
                   test::oracle_minimum(link, X_FL[k], test::stored_points(second.index))));
    }
    QueryConfig config;
    config.max_distance = scene % 2 == 0 ? 2.0 : 0.1;  // or most is out of range
    config.deadline = 1e3;
    bool complete = false;
    for (double step = 0.0; !complete; step = std::ceil(1.2 * step + 0.5)) {
      ProximityQuery query(scene % 4 < 2 ? packed : with_fields, config);
      std::vector<LinkProximity> results;
      Deadline::asks_left_for_test = static_cast<std::int64_t>(step);
      complete = query.run(X_FL, known, {&first, &second}, &results);
      Deadline::asks_left_for_test = -1;
      stopped += complete ? 0 : 1;
      expect_bounds(results, solids, X_FL, truth, "step " + std::to_string(step), &answers);
      ASSERT_FALSE(HasFatalFailure());
    }
  }
  EXPECT_GT(stopped, test::scaled(600));
  EXPECT_GT(answers.all, stopped);
  EXPECT_GT(answers.contacts, test::scaled(60));
}

}  // namespace
}  // namespace ist
