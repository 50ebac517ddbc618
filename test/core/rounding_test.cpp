// Rounding in lower bounds: far from the origin, where a coordinate's last bit is half a
// micrometre, no bound may be above the truth, not by a nanometre. Spheres show it best: their
// cover spheres are they themselves, so nothing but rounding is between bound and truth.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/geometry/float_rounding.h"
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

}  // namespace
}  // namespace ist
