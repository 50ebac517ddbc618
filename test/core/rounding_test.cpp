// Rounding in lower bounds: far from the origin, where a coordinate's last bit is half a
// micrometre, no bound may be above the truth, not by a nanometre. Spheres show it best: their
// cover spheres are they themselves, so nothing but rounding is between bound and truth.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/relative_pose.h"
#include "ist_proximity/proximity/self_query.h"
#include "support/box_oracle.h"
#include "support/exact_distance.h"
#include "support/meshes.h"
#include "support/robot_of_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

using Point = Eigen::Vector3d;

// [m] The smallest distance, in extended precision, from a sphere about `center`.
double exact_distance(const Point& center, double radius, const std::vector<Point>& points) {
  long double least = std::numeric_limits<long double>::infinity();
  for (const Point& p : points) {
    const Eigen::Matrix<long double, 3, 1> off = p.cast<long double>() - center.cast<long double>();
    least = std::min(least, off.norm() - static_cast<long double>(radius));
  }
  return static_cast<double>(least);
}

// Points at nearly the same distance, on two opposite sides of the sphere: a centre that float has
// moved by half a bit makes one side nearer and the other farther than it is.
std::vector<Point> two_sides(const Point& center, double radius, double spread, test::Rng* rng) {
  std::vector<Point> points;
  const double distance = radius + test::uniform(rng, 0.001, 0.1);
  Point axis(1, 1, 1);
  for (int i = 0; i < 3; ++i) axis[i] *= test::uniform(rng, 0, 1) < 0.5 ? 1.0 : -1.0;
  for (int k = 0; k < 12; ++k) {
    const Point direction =
        ((k % 2 == 0 ? 1.0 : -1.0) * axis + test::random_vector(rng, 0.2)).normalized();
    points.push_back(center + (distance + test::uniform(rng, 0, spread)) * direction);
  }
  return points;
}

// The nearest float on the right side of a number, as std::nextafter() says it.
TEST(FloatRounding, IsThatOfNextAfter) {
  test::Rng rng(91);
  constexpr double kInf = std::numeric_limits<double>::infinity();
  constexpr float kMax = std::numeric_limits<float>::max();
  std::vector<double> values = {0.0, -0.0, 1.0, -1.0, 1e-300, -1e-300, 1e-45, -1e-45, kInf, -kInf};
  for (int i = 0; i < 20000; ++i) {
    values.push_back(test::uniform(&rng, -1.0, 1.0) * std::pow(10.0, test::uniform(&rng, -44, 37)));
    values.push_back(static_cast<float>(values.back()));
  }
  for (const double value : values) {
    const auto nearest = static_cast<float>(value);
    const float up = nearest >= value ? nearest : std::nextafter(nearest, kMax);
    const float down = nearest <= value ? nearest : std::nextafter(nearest, -kMax);
    ASSERT_EQ(round_up(value), up) << value;
    ASSERT_EQ(round_down(value), down) << value;
  }
  EXPECT_TRUE(std::isnan(round_up(std::numeric_limits<double>::quiet_NaN())));
}

TEST(Rounding, NoLowerBoundIsAboveTheTruthFarFromTheOrigin) {
  constexpr double kRadius = 0.05;
  test::Rng rng(71);
  const auto model = test::make_model({Sphere{kRadius}}, 0.005);
  ProximityQuery query(model, {});
  std::vector<LinkProximity> results;
  RobotProximity robot;
  for (int i = 0; i < test::scaled(40000); ++i) {
    QueryConfig config;
    config.max_distance = 0.2;
    config.tolerance = i % 4 == 0 ? 0.0 : 0.001;
    query.set_config(config);
    // Just above 4 m, where the last bit is worth most in relation to the number.
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    for (int axis = 0; axis < 3; ++axis) {
      X_FL.translation()[axis] = (i % 2 == 0 ? 1.0 : -1.0) * test::uniform(&rng, 4.16, 4.3);
    }
    const std::vector<Point> points =
        two_sides(X_FL.translation(), kRadius, std::pow(10.0, test::uniform(&rng, -8, -5)), &rng);
    const CloudSnapshot cloud = test::make_snapshot(points);
    const std::vector<Point> stored = test::stored_points(cloud.index);
    for (int step = 0; step < 3; ++step) {
      const double truth = std::min(exact_distance(X_FL.translation(), kRadius, points),
                                    exact_distance(X_FL.translation(), kRadius, stored));
      if (step < 2) {
        ASSERT_TRUE(query.run({X_FL}, {true}, {&cloud}, &results));
        ASSERT_LE(results[0].lower_bound, truth)
            << i << ", step " << step << ": " << results[0].lower_bound - truth << " m too high";
      } else {
        ASSERT_TRUE(query.run_minimum({X_FL}, {true}, {&cloud}, &robot));
        ASSERT_LE(robot.nearest.lower_bound, truth) << i;
      }
      X_FL.translation() += test::random_vector(&rng, 1e-5);
    }
  }
}

// Small steps, exact bounds: a displacement that is a thousandth too small shows after a while.
TEST(Rounding, KeptBoundsFallByAllThatALinkMoves) {
  constexpr double kRadius = 0.05;
  test::Rng rng(72);
  const auto model = test::make_model({Sphere{kRadius}}, 0.005);
  std::vector<LinkProximity> results;
  QueryConfig config;
  config.tolerance = 0.02;
  for (int run = 0; run < test::scaled(200); ++run) {
    ProximityQuery query(model, config);
    const Point toward = test::random_vector(&rng, 1.0).normalized();
    const CloudSnapshot cloud = test::make_snapshot({0.3 * toward, -2.0 * toward});
    const std::vector<Point> stored = test::stored_points(cloud.index);
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    for (int step = 0; step < 60; ++step) {
      ASSERT_TRUE(query.run({X_FL}, {true}, {&cloud}, &results));
      const double truth = exact_distance(X_FL.translation(), kRadius, stored);
      ASSERT_LE(results[0].lower_bound, truth)
          << run << ", step " << step << ": " << results[0].lower_bound - truth << " m too high";
      X_FL.translation() += 0.002 * toward;
    }
  }
}

// Poses that is_rigid() accepts need not be rotations to the last bit: each step of a controller's
// integration, or a quaternion in float, adds to their drift. Whatever is taken for the true place
// of the link, no lower bound may be above the truth.

constexpr double kDrift = 9e-7;  // of the elements of R^T R - I; is_rigid() accepts 1e-6

// A pose with such a drift: the link larger, smaller, or sheared.
Eigen::Isometry3d drifted(const Eigen::Isometry3d& X, int kind, test::Rng* rng) {
  Eigen::Matrix3d stretch = Eigen::Matrix3d::Zero();
  if (kind % 3 != 2) {
    stretch.diagonal().setConstant(kind % 3 == 0 ? kDrift : -kDrift);
  } else {
    for (Eigen::Index i = 0; i < 3; ++i) {
      for (Eigen::Index j = 0; j <= i; ++j) {
        stretch(i, j) = stretch(j, i) = test::uniform(rng, 0, 1) < 0.5 ? kDrift : -kDrift;
      }
    }
  }
  Eigen::Isometry3d result = X;
  result.linear() = X.linear() * (Eigen::Matrix3d::Identity() + 0.5 * stretch);
  return result;
}

// The true distance by every meaning that the pose may have: the mesh posed by it, and the points
// taken to the link's frame by its transpose or its inverse.
double least_truth(const TriangleMesh& mesh, const Eigen::Isometry3d& X_FL,
                   const std::vector<Point>& points_F) {
  TriangleMesh posed = mesh;
  for (Point& v : posed.vertices) v = X_FL * v;
  const Eigen::Matrix3d transpose = X_FL.linear().transpose(), inverse = X_FL.linear().inverse();
  double least = std::numeric_limits<double>::infinity();
  for (const Point& p : points_F) {
    const Point from_origin = p - X_FL.translation();
    least = std::min({least, test::exact_signed_distance(posed, p),
                      test::exact_signed_distance(mesh, transpose * from_origin),
                      test::exact_signed_distance(mesh, inverse * from_origin)});
  }
  return least;
}

// Before: up to 0.9 um above the truth.
TEST(DriftedPose, NoLowerBoundIsAboveTheTruth) {
  test::Rng rng(62);
  std::vector<TriangleMesh> meshes = {test::box({1.0, 0.1, 0.1}), test::box({0.3, 0.2, 1.4}),
                                      test::icosphere(0.4, 1)};
  for (Point& v : meshes[1].vertices) v += Point(0, 0, 0.7);
  std::vector<Shape> shapes(meshes.begin(), meshes.end());
  const auto model = test::make_model(shapes, 0.005);
  ProximityQuery query(model, {});
  std::vector<LinkProximity> results;
  RobotProximity robot;
  const std::vector<bool> known(meshes.size(), true);
  std::vector<Eigen::Isometry3d> X(meshes.size()), X_FL(meshes.size());
  std::vector<Point> points;
  CloudSnapshot cloud;
  int contacts = 0;
  for (int i = 0; i < test::scaled(4000); ++i) {
    if (i % 8 == 0) {  // the scene stays for some steps: bounds are kept
      points.clear();
      for (Eigen::Isometry3d& pose : X) pose = test::random_pose(&rng, 0.3);
      for (int k = 0; k < 3; ++k) {
        const std::size_t link = static_cast<std::size_t>(test::uniform(&rng, 0, 3));
        const auto& vertices = meshes[link].vertices;
        points.push_back(X[link] * vertices[static_cast<std::size_t>(k) % vertices.size()] +
                         test::random_vector(&rng, std::pow(10.0, test::uniform(&rng, -4, -0.5))));
      }
      cloud = test::make_snapshot(points, points[0]);
    }
    for (std::size_t l = 0; l < X.size(); ++l) {
      X[l] = X[l] * test::random_pose(&rng, 0.0001);
      X[l].linear() = Eigen::Quaterniond(X[l].linear()).normalized().toRotationMatrix();
      X_FL[l] = test::uniform(&rng, 0, 1) < 0.2 ? X[l] : drifted(X[l], i, &rng);
    }
    QueryConfig config;
    config.max_distance = 5.0;
    config.tolerance = i % 2 == 0 ? 0.0 : 0.001;
    query.set_config(config);
    ASSERT_TRUE(query.run(X_FL, known, {&cloud}, &results));
    const std::vector<Point> stored = test::stored_points(cloud.index);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t l = 0; l < X.size(); ++l) {
      const double truth = std::min(least_truth(meshes[l], X_FL[l], points),
                                    least_truth(meshes[l], X_FL[l], stored));
      ASSERT_LE(results[l].lower_bound, truth)
          << i << ", link " << l << ": " << results[l].lower_bound - truth << " m too high";
      ASSERT_LT(
          (results[l].p_FCl - results[l].p_FCo - results[l].distance * results[l].direction).norm(),
          1e-12);
      least = std::min(least, truth);
      contacts += results[l].state == LinkState::kContact ? 1 : 0;
    }
    ASSERT_TRUE(query.run_minimum(X_FL, known, {&cloud}, &robot));
    ASSERT_LE(robot.nearest.lower_bound, least) << i;
  }
  EXPECT_GT(contacts, 0);
}

// A map's pose comes from tf, too. The lever is the distance from the map's origin.
TEST(DriftedPose, NoLowerBoundIsAboveTheTruthInADriftedMap) {
  test::Rng rng(63);
  const auto model = test::make_model({Sphere{0.1}}, 0.005);
  std::vector<LinkProximity> results;
  for (int i = 0; i < test::scaled(20000); ++i) {
    const Point middle = test::random_vector(&rng, 2.0);
    const Eigen::AlignedBox3d box(middle - Point::Constant(0.05), middle + Point::Constant(0.05));
    const CloudSnapshot cloud =
        test::make_map({box}, drifted(test::random_pose(&rng, 1.0), i, &rng));
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    X_FL.translation() = cloud.X_FM * middle + test::random_vector(&rng, 1.0);
    QueryConfig config;
    config.max_distance = 5.0;
    config.tolerance = 0.0;
    ASSERT_TRUE(ProximityQuery(model, config).run({X_FL}, {true}, {&cloud}, &results));
    const Point center_F = X_FL.translation();
    const auto distance_M = [&](const Eigen::Matrix3d& R_MF) {
      return std::sqrt(box.squaredExteriorDistance(R_MF * (center_F - cloud.X_FM.translation()))) -
             0.1;
    };
    const double truth = std::min(distance_M(cloud.X_FM.linear().transpose()),
                                  distance_M(cloud.X_FM.linear().inverse()));
    if (truth < 1e-3) continue;
    ASSERT_LE(results[0].lower_bound, truth) << i;
    ASSERT_GT(results[0].lower_bound, truth - 2e-5);
  }
}

TEST(DriftedPose, NoLowerBoundOfAPairIsAboveTheTruth) {
  test::Rng rng(64);
  const double radius = 0.4;
  const Point center(0, 0, 0.5);
  const LinkGeometry ball = {GeometryElement{Sphere{radius}, test::at(center), "test"}};
  const auto model = build_robot_model(test::robot_of({ball, ball}), {});
  QueryConfig config;
  config.max_distance = 5.0;
  SelfQuery query(model, {{0, 1}}, config);
  std::vector<PairProximity> results;
  for (int i = 0; i < 20000; ++i) {
    std::vector<Eigen::Isometry3d> X_FL;
    for (int l = 0; l < 2; ++l) X_FL.push_back(drifted(test::random_pose(&rng, 1.5), i, &rng));
    query.run(X_FL, {true, true}, &results);
    // Each link stretched by its pose, if it is stretched evenly.
    if (i % 3 == 2) continue;
    const double larger = 1.0 + (i % 3 == 0 ? 0.5 : -0.5) * kDrift;
    const double truth = (X_FL[0] * center - X_FL[1] * center).norm() - 2.0 * larger * radius;
    if (truth < 1e-3) continue;
    ASSERT_LE(results[0].lower_bound, truth) << i;
    ASSERT_GT(results[0].lower_bound, truth - 2e-5) << i;
  }
}

}  // namespace
}  // namespace ist
