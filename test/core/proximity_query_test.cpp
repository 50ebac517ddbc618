#include "ist_proximity/proximity/proximity_query.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/proximity/deadline.h"
#include "support/meshes.h"
#include "support/oracle.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/tiles.h"

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
    switch (kind % 4) {
      case 0:
        points.push_back(test::random_vector(rng, 0.6));
        break;  // a volume
      case 1:
        points.push_back(middle + s * a + t * b);
        break;  // a plane
      case 2:
        points.push_back(middle + s * a);
        break;  // a line
      default:
        points.push_back(middle + test::random_vector(rng, 0.05));  // a cluster
    }
  }
  return points;
}

// The points in float as the index stores them: a query is exact about these.
std::vector<Eigen::Vector3d> stored_points(const CloudSnapshot& snapshot,
                                           const Eigen::Isometry3d& X_LF) {
  std::vector<Eigen::Vector3d> points;
  for (const PointTile& tile : test::tiles_of(snapshot.index)) {
    for (int k = 0; k < tile.count; ++k) {
      points.push_back(X_LF * (snapshot.index.X_FO() * tile.point(k)));
    }
  }
  return points;
}

void expect_consistent(const LinkProximity& result, const Eigen::Isometry3d& X_FL) {
  if (result.state < LinkState::kNear) return;
  EXPECT_NEAR(result.direction.norm(), 1.0, 1e-9);
  EXPECT_LT((result.p_FCl - result.p_FCo - result.distance * result.direction).norm(), 1e-9);
  EXPECT_LT((X_FL * result.p_LCl - result.p_FCl).norm(), 1e-12);
  EXPECT_EQ(result.state == LinkState::kContact, result.distance < 0.0);
  EXPECT_LE(result.lower_bound, result.distance);
}

class AgainstOracle : public ::testing::TestWithParam<double> {};

TEST_P(AgainstOracle, RandomScenes) {
  const double tolerance = GetParam();
  test::Rng rng(11);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = test::make_model(shapes_of(meshes), 0.005);
  QueryConfig config;
  config.tolerance = tolerance;
  config.max_distance = 0.3;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  std::vector<Eigen::Isometry3d> X_FL(meshes.size());
  const std::vector<bool> known(meshes.size(), true);
  int clear = 0, near = 0, contact = 0;
  for (int scene = 0; scene < 60; scene += test::kSanitized ? 6 : 1) {
    const CloudSnapshot snapshot =
        test::make_snapshot(random_cloud(&rng, scene, 1 + scene * 7), test::random_vector(&rng, 1));
    for (int step = 0; step < 4; ++step) {  // later steps have a warm start
      for (Eigen::Isometry3d& X : X_FL) {
        X = step == 0 ? test::random_pose(&rng, 0.4)
                      : Eigen::Isometry3d(X * test::random_pose(&rng, 0.01));
      }
      ASSERT_TRUE(query.run(X_FL, known, {&snapshot}, &results));
      for (std::size_t i = 0; i < meshes.size(); ++i) {
        const double truth =
            test::oracle_minimum(meshes[i], stored_points(snapshot, X_FL[i].inverse()));
        const LinkProximity& result = results[i];
        expect_consistent(result, X_FL[i]);
        if (result.state == LinkState::kClear) {
          ++clear;
          ASSERT_GE(truth, config.max_distance);
          ASSERT_EQ(result.distance, kInfinity);
          ASSERT_GE(result.lower_bound, config.max_distance);
          continue;
        }
        result.state == LinkState::kNear ? ++near : ++contact;
        ASSERT_LE(result.lower_bound, truth);
        ASSERT_GE(result.distance, truth - 1e-9);
        ASSERT_EQ(truth < 0.0, result.state == LinkState::kContact);
        ASSERT_LE(result.distance - result.lower_bound, tolerance + 2e-6);
      }
    }
  }
  EXPECT_GT(clear, test::scaled(50));
  EXPECT_GT(near, test::scaled(200));
  EXPECT_GT(contact, test::scaled(50));
}

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
  for (const double height : {0.003, 0.03, 0.3, 3.0}) {
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
        const double truth =
            test::oracle_minimum(meshes[i], stored_points(snapshot, X_FL[i].inverse()));
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

TEST(ProximityQuery, WarmStartNeverChangesTheAnswer) {
  test::Rng rng(12);
  const auto model = test::make_model(shapes_of(link_meshes()), 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  config.max_distance = 5.0;
  ProximityQuery warm(model, config);
  const CloudSnapshot snapshot = test::make_snapshot(random_cloud(&rng, 0, 2000));
  std::vector<Eigen::Isometry3d> X_FL(model->links.size(), Eigen::Isometry3d::Identity());
  const std::vector<bool> known(model->links.size(), true);
  std::vector<LinkProximity> a, b;
  for (int step = 0; step < test::scaled(300); ++step) {
    for (Eigen::Isometry3d& X : X_FL) X = X * test::random_pose(&rng, 0.003);
    ProximityQuery cold(model, config);
    warm.run(X_FL, known, {&snapshot}, &a);
    cold.run(X_FL, known, {&snapshot}, &b);
    for (std::size_t i = 0; i < a.size(); ++i) {
      ASSERT_EQ(a[i].state, b[i].state);
      ASSERT_NEAR(a[i].distance, b[i].distance, 1e-9);
    }
  }
}

// The warm start measures a point that touches, at distance 0; another one is inside by less than
// the tolerance.
TEST(ProximityQuery, PointInsideIsFoundWhereTheWarmStartTouches) {
  const auto model = test::make_model({Box{{0.25, 0.25, 0.25}}}, 0.005);
  QueryConfig config;
  config.tolerance = 0.005;
  ProximityQuery query(model, config);
  const CloudSnapshot cloud = test::make_snapshot({{0.125, 0.0, 0.0}, {0.0, 0.122, 0.0}});
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  X_FL.translation() = Eigen::Vector3d(-0.01, -0.1, 0.0);
  std::vector<LinkProximity> results;
  ASSERT_TRUE(query.run({X_FL}, {true}, {&cloud}, &results));
  ASSERT_EQ(results[0].point, 0U);  // the next query measures it first
  X_FL.translation().setZero();
  ASSERT_TRUE(query.run({X_FL}, {true}, {&cloud}, &results));
  EXPECT_EQ(results[0].state, LinkState::kContact);
  EXPECT_EQ(results[0].point, 1U);
}

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
  const std::vector<Eigen::Isometry3d> X_FL(1, Eigen::Isometry3d::Identity());
  std::vector<LinkProximity> results;
  const CloudSnapshot near = test::make_snapshot({{0.5, 0, 0}});
  query.run(X_FL, {true}, {&near}, &results);
  EXPECT_NEAR(results[0].distance, 0.4, 1e-6);
  EXPECT_NEAR(results[0].lower_bound, 0.35, 1e-5);
  const CloudSnapshot edge = test::make_snapshot({{1.12, 0, 0}});
  query.run(X_FL, {true}, {&edge}, &results);
  EXPECT_EQ(results[0].state, LinkState::kNear) << "1.02 m less the margin is not proven to be 1 m";
  const CloudSnapshot far = test::make_snapshot({{1.2, 0, 0}});
  query.run(X_FL, {true}, {&far}, &results);
  EXPECT_EQ(results[0].state, LinkState::kClear);
}

TEST(ProximityQuery, BoundsHoldWheneverTheDeadlinePasses) {
  test::Rng rng(14);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = test::make_model(shapes_of(meshes), 0.005);
  QueryConfig config;
  config.max_distance = 2.0;
  const std::vector<bool> known(meshes.size(), true);
  std::vector<Eigen::Isometry3d> X_FL(meshes.size());
  std::vector<LinkProximity> results;
  ProximityQuery query(model, config);
  int unfinished = 0;
  for (int i = 0; i < test::scaled(200); ++i) {
    const CloudSnapshot snapshot = test::make_snapshot(random_cloud(&rng, i, 1500));
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng, 0.3);
    config.deadline = 1e-7 * std::pow(10.0, test::uniform(&rng, 0.0, 4.0));
    query.set_config(config);
    if (!query.run(X_FL, known, {&snapshot}, &results)) ++unfinished;
    for (std::size_t k = 0; k < meshes.size(); ++k) {
      if (results[k].state == LinkState::kUnknown) continue;
      const double truth =
          test::oracle_minimum(meshes[k], stored_points(snapshot, X_FL[k].inverse()));
      expect_consistent(results[k], X_FL[k]);
      ASSERT_LE(results[k].lower_bound, std::min(truth, config.max_distance));
      ASSERT_GE(results[k].distance, std::min(truth, config.max_distance) - 1e-9);
    }
  }
  EXPECT_GT(unfinished, test::scaled(20));
}

// The same at every single step, in place of where the clock happens to stop a query: two clouds,
// and points inside. Where the answer has a point, its distance is that point's, with its side.
// What holds of a query's answers wherever it stopped. @param what  of the query
void expect_bounds(const std::vector<LinkProximity>& results, const std::vector<Solid>& solids,
                   const std::vector<Eigen::Isometry3d>& X_FL, const std::vector<double>& truth,
                   const std::string& what) {
  for (std::size_t k = 0; k < results.size(); ++k) {
    const LinkProximity& result = results[k];
    ASSERT_LE(result.lower_bound, truth[k] + 1e-9) << what << ", link " << k;
    if (result.state < LinkState::kNear) continue;
    expect_consistent(result, X_FL[k]);
    ASSERT_GE(result.distance, truth[k] - 1e-7) << what << ", link " << k;
    const double exact = solids[k].signed_distance(X_FL[k].inverse() * result.p_FCo).distance;
    ASSERT_NEAR(result.distance, exact, 1e-7) << what << ", link " << k;
  }
}

TEST(ProximityQuery, BoundsHoldWhereverAQueryStops) {
  test::Rng rng(143);
  std::vector<TriangleMesh> meshes = link_meshes();
  meshes.push_back(test::open_box({0.1, 0.1, 0.15}));
  const auto model = test::make_model(shapes_of(meshes), 0.005);
  std::vector<Solid> solids;
  for (const LinkModel& link : model->links) solids.push_back(link.solid);
  const std::vector<bool> known(meshes.size(), true);
  int stopped = 0, answered = 0, contacts = 0;
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
      const Eigen::Isometry3d X_LF = X_FL[k].inverse();
      truth.push_back(std::min(test::oracle_minimum(meshes[k], stored_points(first, X_LF)),
                               test::oracle_minimum(meshes[k], stored_points(second, X_LF))));
    }
    QueryConfig config;
    config.max_distance = scene % 2 == 0 ? 2.0 : 0.1;  // or most is out of range
    config.deadline = 1e3;
    bool complete = false;
    for (double step = 0.0; !complete; step = std::ceil(1.2 * step + 0.5)) {
      ProximityQuery query(model, config);
      std::vector<LinkProximity> results;
      Deadline::asks_left_for_test = static_cast<std::int64_t>(step);
      complete = query.run(X_FL, known, {&first, &second}, &results);
      Deadline::asks_left_for_test = -1;
      stopped += complete ? 0 : 1;
      expect_bounds(results, solids, X_FL, truth, "step " + std::to_string(step));
      ASSERT_FALSE(HasFatalFailure());
      for (const LinkProximity& result : results) {
        answered += result.state < LinkState::kNear ? 0 : 1;
        contacts += result.state == LinkState::kContact ? 1 : 0;
      }
    }
  }
  EXPECT_GT(stopped, test::scaled(600));
  EXPECT_GT(answered, stopped);
  EXPECT_GT(contacts, test::scaled(60));
}

// The deadline passes in a cloud that is far and slow to search, since all of its points are
// equally near; the cloud after it is nearer.
TEST(ProximityQuery, BoundsHoldForCloudsThatADeadlineLeftUnsearched) {
  test::Rng rng(142);
  const auto model = test::make_model({Sphere{0.1}}, 0.005);
  std::vector<Eigen::Vector3d> shell_F;
  for (int i = 0; i < 20000; ++i) {
    shell_F.push_back(0.6 * test::random_vector(&rng, 1.0).normalized());
  }
  const CloudSnapshot shell = test::make_snapshot(shell_F);
  const CloudSnapshot near = test::make_snapshot({{0.2, 0.0, 0.0}});
  std::vector<LinkProximity> results;
  int late = 0;
  for (int i = 0; i < test::scaled(200); ++i) {
    QueryConfig config;
    config.tolerance = 0.0;
    config.deadline = 1e-6 * std::pow(10.0, test::uniform(&rng, 0.0, 3.0));
    ProximityQuery query(model, config);
    if (query.run({Eigen::Isometry3d::Identity()}, {true}, {&shell, &near}, &results)) continue;
    if (results[0].state == LinkState::kUnknown) continue;
    ASSERT_LE(results[0].lower_bound, 0.1);
    ++late;
  }
  EXPECT_GT(late, test::kSanitized ? -1 : 20);
}

// Whatever a deadline leaves unmeasured, the point of an answer is on the side that the state says.
TEST(ProximityQuery, LateAnswersSayOnWhichSideTheirPointIs) {
  test::Rng rng(141);
  const TriangleMesh mesh = test::torus(0.1, 0.03, 24, 12);
  const auto model = test::make_model({Shape(mesh)}, 0.003);
  std::vector<LinkProximity> results;
  int contacts = 0;
  for (int i = 0; i < test::scaled(500); ++i) {
    std::vector<Eigen::Vector3d> inside_F;
    for (int k = 0; k < 300; ++k) {
      const double angle = test::uniform(&rng, 0.0, 2.0 * EIGEN_PI);
      inside_F.push_back(0.1 * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0) +
                         test::random_vector(&rng, 0.015));
    }
    const CloudSnapshot cloud = test::make_snapshot(inside_F);
    QueryConfig config;
    config.deadline = 1e-6 * std::pow(10.0, test::uniform(&rng, 0.0, 2.0));
    ProximityQuery query(model, config);
    query.run({Eigen::Isometry3d::Identity()}, {true}, {&cloud}, &results);
    if (results[0].state == LinkState::kUnknown) continue;
    ASSERT_EQ(results[0].state, LinkState::kContact) << results[0].distance;
    ASSERT_LE(results[0].lower_bound, results[0].distance);
    ++contacts;
  }
  EXPECT_GT(contacts, test::kSanitized ? -1 : 100);
}

TEST(ProximityQuery, DistancesAreTheSameFarFromTheOrigin) {
  test::Rng rng(15);
  const auto model = test::make_model(shapes_of(link_meshes()), 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  config.max_distance = 5.0;
  const Eigen::Vector3d far(1e6, -2e6, 5e5);
  const std::vector<Eigen::Vector3d> points = random_cloud(&rng, 0, 500);
  std::vector<Eigen::Vector3d> far_points;
  for (const Eigen::Vector3d& p : points) far_points.push_back(p + far);
  const CloudSnapshot here = test::make_snapshot(points),
                      there = test::make_snapshot(far_points, far);
  std::vector<Eigen::Isometry3d> X_here(model->links.size()), X_there;
  for (Eigen::Isometry3d& X : X_here) {
    X = test::random_pose(&rng, 0.5);
    X_there.push_back(Eigen::Translation3d(far) * X);
  }
  const std::vector<bool> known(model->links.size(), true);
  std::vector<LinkProximity> a, b;
  ProximityQuery(model, config).run(X_here, known, {&here}, &a);
  ProximityQuery(model, config).run(X_there, known, {&there}, &b);
  for (std::size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i].distance, b[i].distance, 1e-6);
}

TEST(ProximityQuery, PointsOnTheSurfaceAndAtCentres) {
  const auto model = test::make_model(
      {Sphere{0.1}, Box{{0.2, 0.2, 0.2}}, Shape(test::box({0.2, 0.2, 0.2}))}, 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery query(model, config);
  const std::vector<Eigen::Isometry3d> X_FL(3, Eigen::Isometry3d::Identity());
  std::vector<LinkProximity> results;
  for (const Eigen::Vector3d& p :
       {Eigen::Vector3d(0.1, 0, 0), Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0.1, 0.1),
        Eigen::Vector3d(0.1, 0.1, 0), Eigen::Vector3d(1e-300, 0, 0)}) {
    const CloudSnapshot snapshot = test::make_snapshot(std::vector<Eigen::Vector3d>(40, p));
    query.run(X_FL, {true, true, true}, {&snapshot}, &results);
    for (const LinkProximity& result : results) {
      ASSERT_GE(result.state, LinkState::kNear);
      EXPECT_NEAR(result.direction.norm(), 1.0, 1e-9);
      expect_consistent(result, Eigen::Isometry3d::Identity());
    }
    const Eigen::Vector3d outside = p.cwiseAbs() - Eigen::Vector3d::Constant(0.1);
    EXPECT_NEAR(results[1].distance, outside.maxCoeff(), 1e-7);
    EXPECT_NEAR(results[2].distance, results[1].distance, 1e-7);
  }
}

TEST(IsRigid, RefusesScaledReflectedAndNonFinitePoses) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  EXPECT_TRUE(is_rigid(X));
  X.linear() *= 1.001;
  EXPECT_FALSE(is_rigid(X)) << "scaled";
  X.setIdentity();
  X.linear()(2, 2) = -1.0;
  EXPECT_FALSE(is_rigid(X)) << "reflected";
  X.setIdentity();
  X.translation().y() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_rigid(X));
  X.setIdentity();
  X.linear()(0, 1) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(is_rigid(X));
}

}  // namespace
}  // namespace ist
