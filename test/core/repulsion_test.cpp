#include "ist_proximity/repulsion/repulsion.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "ist_proximity/cloud/ingest.h"
#include "support/box_oracle.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

using Eigen::Vector3d;
using test::at;

constexpr double kInf = std::numeric_limits<double>::infinity();
const Eigen::Isometry3d kHere = Eigen::Isometry3d::Identity();

InnerSphere sphere(double x, double y, double z, double radius) {
  return {{x, y, z}, radius, radius};
}

std::shared_ptr<const RobotModel> robot_of(const std::vector<InnerSphere>& spheres) {
  auto model = std::make_shared<RobotModel>();
  model->links.resize(1);
  model->links[0].packing.spheres = spheres;
  return model;
}

// A bar of seven overlapping spheres along x.
std::vector<InnerSphere> bar() {
  std::vector<InnerSphere> spheres;
  for (int i = -3; i <= 3; ++i) spheres.push_back(sphere(0.03 * i, 0.0, 0.0, 0.03));
  return spheres;
}

CloudSnapshot cloud_of(const std::vector<Vector3d>& points, const Vector3d& origin = {0, 0, 0}) {
  CloudSnapshot cloud = test::make_snapshot(points, origin);
  cloud.index.bvh().set_thinning(cloud.thinning);
  return cloud;
}

// A square of side 0.4 m with a point every `spacing`, about `centre`.
std::vector<Vector3d> wall(const Vector3d& centre, const Vector3d& u, const Vector3d& v,
                           double spacing) {
  std::vector<Vector3d> points;
  const int half = static_cast<int>(0.2 / spacing);
  for (int i = -half; i <= half; ++i) {
    for (int j = -half; j <= half; ++j) points.push_back(centre + spacing * (i * u + j * v));
  }
  return points;
}

std::vector<Vector3d> both(std::vector<Vector3d> a, const std::vector<Vector3d>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

// A place on an obstacle that pushes a sphere. [m] fixed frame
struct Push {
  InnerSphere sphere;
  Vector3d p;
  double weight;
};

// The thinned points of a cloud, each weighted by how much of its cell a surface through it covers.
std::vector<Push> pushes_of(const CloudSnapshot& cloud, const std::vector<InnerSphere>& spheres) {
  std::vector<Push> all;
  for (const auto& [id, p] : test::thinned_points_of(cloud.index)) {
    const Vector3d cells = p / cloud.thinning;
    const Vector3d off = cells - cells.array().floor().matrix() - Vector3d::Constant(0.5);
    const double section = 1.0 - off.squaredNorm() / 0.75;
    for (const InnerSphere& b : spheres) all.push_back({b, p, 0.01 + 0.99 * section * section});
  }
  return all;
}

// The formula in the header, evaluated pair by pair in double.
struct Expected {
  double nearest = kInf;  // [m] smallest distance
  Vector3d nearest_direction = Vector3d::Zero();
  Vector3d blend = Vector3d::Zero();
  Vector3d torque = Vector3d::Zero();  // each pair's force acts at its own witness on the sphere
};

Expected expected(const std::vector<Push>& pushes, const Eigen::Isometry3d& X_FL,
                  double smoothing) {
  Expected result;
  for (const auto& [b, p, weight] : pushes) {
    const Vector3d to_sphere = X_FL * b.center - p;
    if (to_sphere.norm() - b.radius < result.nearest) {
      result.nearest = to_sphere.norm() - b.radius;
      result.nearest_direction = to_sphere.normalized();
    }
  }
  double weights = 0.0;
  for (const auto& [b, p, weight] : pushes) {
    const Vector3d n = (X_FL * b.center - p).normalized();
    const Vector3d witness = X_FL * b.center - b.radius * n;
    const double root = 1.0 - (n.dot(witness - p) - result.nearest) / smoothing;
    if (root <= 0.0) continue;
    const double w = root * root * weight;
    result.blend += w * n;
    result.torque += w * (witness - X_FL.translation()).cross(n);
    weights += w;
  }
  result.blend /= weights;
  result.torque /= weights;
  return result;
}

LinkProximity near_by(double distance, const Vector3d& direction = Vector3d::UnitZ()) {
  LinkProximity proximity;
  proximity.state = distance < 0.0 ? LinkState::kContact : LinkState::kNear;
  proximity.distance = proximity.lower_bound = distance;
  proximity.direction = direction;
  return proximity;
}

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / 3.14159265358979323846;
}

TEST(Repulsion, unknownIsNanAndClearIsZero) {
  const Repulsion repulsion(robot_of(bar()));
  const CloudSnapshot cloud = cloud_of({{0, 0, 0.2}});
  LinkProximity proximity;
  EXPECT_TRUE(repulsion(0, kHere, {&cloud}, proximity, {}).array().isNaN().all());
  proximity.state = LinkState::kClear;
  proximity.distance = kInf;
  EXPECT_EQ(repulsion(0, kHere, {&cloud}, proximity, {}), Vector3d::Zero());
}

TEST(Repulsion, lengthFallsFromGainAtTouchToZeroAtTheInfluenceDistance) {
  const Repulsion repulsion(robot_of({sphere(0, 0, 0, 0.1)}));
  RepulsionConfig config;
  config.influence_distance = 0.2;
  config.gain = 3.0;
  for (const double distance : {0.0, 0.05, 0.1, 0.15, 0.1999}) {
    const CloudSnapshot cloud = cloud_of({{0, 0, -0.1 - distance}});
    const Vector3d v = repulsion(0, kHere, {&cloud}, near_by(distance), config);
    EXPECT_NEAR(v.norm(), 3.0 * (1.0 - distance / 0.2), 1e-5);
    EXPECT_NEAR(v.z(), v.norm(), 1e-6) << "away from the point";
  }
  for (const double distance : {0.2, 0.21, 0.9}) {
    const CloudSnapshot cloud = cloud_of({{0, 0, -0.1 - distance}});
    EXPECT_EQ(repulsion(0, kHere, {&cloud}, near_by(distance), config), Vector3d::Zero());
  }
}

// A bar, and more spheres than one group of the SIMD kernel holds: each of them pushes.
TEST(Repulsion, agreesWithTheFormula) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> u(-0.4, 0.4);
  std::vector<InnerSphere> grid;  // they do not overlap: all of them are coarse spheres
  for (int i = 0; i < 27; ++i) {
    grid.push_back(sphere(0.1 * (i % 3), 0.1 * (i / 3 % 3), 0.1 * (i / 9), 0.04));
  }
  RepulsionConfig config;
  config.influence_distance = 1.0;
  for (int trial = 0; trial < 80; ++trial) {
    const bool is_grid = trial >= 60;
    config.gain = is_grid ? 1.0 : 2.0;
    const std::vector<InnerSphere> spheres = is_grid ? grid : bar();
    const Repulsion repulsion(robot_of(spheres));
    std::vector<Vector3d> points;
    if (trial % 2 == 0) {
      for (int i = 0; i < 300; ++i) points.emplace_back(u(random), u(random), u(random));
    } else {
      points = wall({u(random), u(random), u(random)}, Vector3d::UnitX(),
                    Vector3d(0, u(random), u(random)).normalized(), 0.01);
    }
    config.smoothing = is_grid ? 0.3 : trial % 3 == 0 ? 0.05 : 0.1;
    const CloudSnapshot cloud = cloud_of(points, {1.0, 0.0, -2.0});
    Eigen::Isometry3d X_FL = at({u(random), u(random), u(random)});
    X_FL.rotate(Eigen::AngleAxisd(5.0 * u(random), Vector3d(1, 2, 3).normalized()));
    const Expected e = expected(pushes_of(cloud, spheres), X_FL, config.smoothing);
    const RepulsiveWrench wrench = repulsion.wrench(0, X_FL, {&cloud}, near_by(e.nearest), config);
    const double length = config.gain * std::min(1.0, 1.0 - e.nearest);
    ASSERT_LT((wrench.force - length * e.blend).norm(), 2e-4) << trial;
    ASSERT_LT((wrench.torque - length * e.torque).norm(), 2e-4) << trial;
  }
}

// A bar slides between two walls, and past a third. With the nearest pair alone, the direction
// would jump by 94 degrees and the vector by 0.79 in one step of 0.12 mm where two walls are
// equally near. The blended vector changes by 0.005 at most.
TEST(Repulsion, isContinuousPastTwoEquallyNearObstacles) {
  const CloudSnapshot cloud =
      cloud_of(both(both(wall({0, 0, -0.15}, Vector3d::UnitX(), Vector3d::UnitY(), 0.02),
                         wall({0, 0, 0.15}, Vector3d::UnitX(), Vector3d::UnitY(), 0.02)),
                    wall({0.25, 0, 0}, Vector3d::UnitY(), Vector3d::UnitZ(), 0.02)));
  const std::vector<InnerSphere> spheres = bar();
  const Repulsion repulsion(robot_of(spheres));
  const RepulsionConfig config;
  Vector3d last = Vector3d::Zero(), last_nearest = Vector3d::UnitZ();
  double largest_step = 0.0, largest_jump = 0.0;
  constexpr int kSteps = 1500;
  for (int i = 0; i <= kSteps; ++i) {
    const double s = static_cast<double>(i) / kSteps;  // 0.15 m up and 0.1 m forward: 0.12 mm each
    const Eigen::Isometry3d X_FL = at({0.1 * s, 0.0033, -0.075 + 0.15 * s});
    const Expected e = expected(pushes_of(cloud, spheres), X_FL, config.smoothing);
    const Vector3d v = repulsion(0, X_FL, {&cloud}, near_by(e.nearest), config);
    if (i > 0) {
      largest_step = std::max(largest_step, (v - last).norm());
      largest_jump = std::max(largest_jump, degrees_between(e.nearest_direction, last_nearest));
    }
    last = v;
    last_nearest = e.nearest_direction;
  }
  EXPECT_GT(largest_jump, 90.0) << "the motion must be a hard one";
  EXPECT_LT(largest_step, 0.01);
}

// A cloud of `count` points on a sphere of radius 0.15 m, thinned by Ingest.
CloudSnapshot sphere_cloud(int count) {
  std::mt19937 random(9);  // a smaller cloud holds the first points of a larger one
  std::normal_distribution<double> normal;
  std::vector<float> data;
  for (int i = 0; i < count; ++i) {
    const Vector3d p = 0.15 * Vector3d(normal(random), normal(random), normal(random)).normalized();
    for (int k = 0; k < 3; ++k) data.push_back(static_cast<float>(p[k]));
  }
  const RawCloud raw = packed_cloud(data.data(), static_cast<std::size_t>(count), 1);
  IngestConfig config;
  config.self_filter = false;
  config.min_range = 0.0;
  CloudSnapshot cloud;
  Ingest(config).run(raw, Eigen::Isometry3d::Identity(), {}, 0.0, &cloud);
  return cloud;
}

// A bar turns and passes a sphere at 1 m/s, in steps of 1 ms. Direction and length change little in
// each step, and little with half or twice as many points (doc/accuracy.md).
TEST(Repulsion, isSmoothAndIndependentOfTheNumberOfPoints) {
  const CloudSnapshot cloud = sphere_cloud(12000), half = sphere_cloud(6000),
                      twice = sphere_cloud(24000);
  const std::vector<InnerSphere> spheres = bar();
  const Repulsion repulsion(robot_of(spheres));
  Vector3d last = Vector3d::Zero();
  double turn = 0.0, length = 0.0;
  for (int i = -250; i <= 250; ++i) {
    Eigen::Isometry3d X_FL = at({0.001 * i, 0.02, 0.22});
    X_FL.rotate(Eigen::AngleAxisd(0.002 * i, Vector3d(1, 2, 3).normalized()));
    double distance = kInf;
    for (const InnerSphere& b : spheres) {
      distance = std::min(distance, (X_FL * b.center).norm() - b.radius - 0.15);
    }
    const auto ask = [&](const CloudSnapshot& c) {
      return repulsion(0, X_FL, {&c}, near_by(distance), {});
    };
    const Vector3d v = ask(cloud);
    EXPECT_LT((ask(half) - v).norm(), 0.02) << i;
    EXPECT_LT((ask(twice) - v).norm(), 0.02) << i;
    if (!last.isZero()) {
      turn = std::max(turn, degrees_between(v, last));
      length = std::max(length, std::abs(v.norm() - last.norm()));
    }
    last = v;
  }
  EXPECT_LT(turn, 2.0);
  EXPECT_LT(length, 0.01);
}

TEST(Repulsion, contactIsBoundedAndContinuous) {
  const Repulsion repulsion(robot_of({sphere(0, 0, 0, 0.1)}));
  RepulsionConfig config;
  config.gain = 2.0;
  Vector3d last(0, 0, 2.0 * (1.0 - 0.02 / 0.3));
  for (double z = -0.12; z < -0.001; z += 0.001) {  // from 20 mm before to 99 mm inside
    const CloudSnapshot cloud = cloud_of({{0, 0, z}});
    const Vector3d v = repulsion(0, kHere, {&cloud}, near_by(-z - 0.1), config);
    EXPECT_LE(v.norm(), 2.0 * (1.0 + 1e-6));
    EXPECT_LT((v - last).norm(), 0.01);
    EXPECT_GT(v.z(), 0.0) << "the force points out of the obstacle, away from the point";
    last = v;
  }
  EXPECT_NEAR(last.norm(), 2.0, 1e-5);
}

TEST(Repulsion, isDefinedAtTouchAndAtASpheresCentre) {
  const Repulsion repulsion(robot_of({sphere(0.5, 0.25, 0, 0.125)}));
  const Vector3d direction = Vector3d(1, 2, -2) / 3.0;
  const CloudSnapshot touch = cloud_of({{0.625, 0.25, 0}});
  EXPECT_LT((repulsion(0, kHere, {&touch}, near_by(0.0), {}) - Vector3d(-1, 0, 0)).norm(), 1e-6);
  const CloudSnapshot centre = cloud_of({{0.5, 0.25, 0}});
  const Vector3d v = repulsion(0, kHere, {&centre}, near_by(-0.125, direction), {});
  EXPECT_LT((v - direction).norm(), 1e-6);
  const CloudSnapshot both = cloud_of({{0.5, 0.25, 0}, {0.5, 0.25, 0.01}});
  EXPECT_TRUE(repulsion(0, kHere, {&both}, near_by(-0.125, direction), {}).allFinite());
}

TEST(Repulsion, spheresOfRadiusZeroCount) {
  const Repulsion repulsion(robot_of({sphere(0, 0, 0, 0)}));
  const CloudSnapshot cloud = cloud_of({{0.1, 0, 0}});
  const Vector3d v = repulsion(0, kHere, {&cloud}, near_by(0.1), {});
  EXPECT_LT((v - Vector3d(-1.0 + 0.1 / 0.3, 0, 0)).norm(), 1e-6);
}

TEST(Repulsion, severalCloudsAreOneObstacle) {
  const std::vector<InnerSphere> spheres = bar();
  const Repulsion repulsion(robot_of(spheres));
  // No point lies on the side of a voxel, and no voxel holds points of both walls.
  const std::vector<Vector3d> a =
      wall({0.004, 0.004, 0.004}, Vector3d::UnitX(), Vector3d::UnitY(), 0.01);
  const std::vector<Vector3d> b =
      wall({-0.206, 0.004, 0.204}, Vector3d::UnitY(), Vector3d::UnitZ(), 0.01);
  const CloudSnapshot cloud = cloud_of(both(a, b)), cloud_a = cloud_of(a, {2, 0, 1}),
                      cloud_b = cloud_of(b, {0, -1, 0}), empty = cloud_of({});
  const Eigen::Isometry3d X_FL = at({-0.03, 0, 0.1});
  const Vector3d together = repulsion(0, X_FL, {&cloud}, near_by(0.07), {});
  const Vector3d apart =
      repulsion(0, X_FL, {&empty, &cloud_a, nullptr, &cloud_b}, near_by(0.07), {});
  EXPECT_LT((together - apart).norm(), 1e-4);
}

// A leaf of a map counts with its point nearest to each sphere.
TEST(Repulsion, boxesAgreeWithTheFormula) {
  std::mt19937_64 rng(5);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto vector = [&] { return Vector3d(unit(rng), unit(rng), unit(rng)); };
  const std::vector<InnerSphere> spheres = bar();
  const Repulsion repulsion(robot_of(spheres));
  const RepulsionConfig config;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<Eigen::AlignedBox3d> boxes;
    for (int i = 0; i < 40; ++i) {
      const Vector3d low = 0.4 * vector() + Vector3d(0.0, 0.0, 0.6);
      boxes.emplace_back(low, low + Vector3d::Constant(0.05 * (1 << i % 3)));
    }
    const Eigen::Isometry3d X_FM(Eigen::Translation3d(0.1 * vector()) *
                                 Eigen::AngleAxisd(0.5 * unit(rng), vector().normalized()));
    const CloudSnapshot map = test::make_map(boxes, X_FM);
    std::vector<Push> pushes;
    for (const InnerSphere& b : spheres) {
      for (const Eigen::AlignedBox3d& box : boxes) {
        const Vector3d center_M = X_FM.inverse() * b.center;
        pushes.push_back({b, X_FM * center_M.cwiseMax(box.min()).cwiseMin(box.max()), 1.0});
      }
    }
    const Expected truth = expected(pushes, kHere, config.smoothing);
    const RepulsiveWrench found = repulsion.wrench(0, kHere, {&map}, near_by(0.1), config);
    const double strength = config.gain * (1.0 - 0.1 / config.influence_distance);
    EXPECT_LT((found.force - strength * truth.blend).norm(), 1e-4);
    EXPECT_LT((found.torque - strength * truth.torque).norm(), 1e-4);
  }
}

TEST(Repulsion, losesNothingFarFromTheFixedFramesOrigin) {
  const Vector3d base(691000, 5334000, 520);
  std::vector<Vector3d> points = wall({0, 0, 0}, Vector3d::UnitX(), Vector3d::UnitY(), 0.01);
  const Repulsion repulsion(robot_of(bar()));
  const CloudSnapshot here = cloud_of(points);
  for (Vector3d& p : points) p += base;
  const CloudSnapshot there = cloud_of(points, base);
  const Vector3d p(0.123, 0.05, 0.08);
  EXPECT_LT((repulsion(0, at(p), {&here}, near_by(0.05), {}) -
             repulsion(0, at(base + p), {&there}, near_by(0.05), {}))
                .norm(),
            1e-5);
}

// There are no pairs to sum over, so the direction is that of the distance query.
TEST(Repulsion, withoutPairsItHasTheDirectionOfTheQuery) {
  const Repulsion repulsion(robot_of({}));
  const CloudSnapshot cloud = cloud_of({{0, 0, 0}}), empty = cloud_of({});
  const Vector3d v = repulsion(0, kHere, {&cloud}, near_by(0.15, Vector3d::UnitY()), {});
  EXPECT_LT((v - 0.5 * Vector3d::UnitY()).norm(), 1e-12);
}

// A scene that is turned as a whole gets a wrench that is turned with it. The map's own frame
// turns, so force, torque and the arm of pairs without a direction have to be turned out of it.
TEST(Repulsion, turnedMapsTurnForceAndTorque) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(-1.0, 1.0);
  const std::vector<InnerSphere> spheres = bar();
  const Repulsion repulsion(robot_of(spheres));
  RepulsionConfig config;
  config.influence_distance = 1.0;
  int undirected = 0;
  double largest_torque = 0.0;
  for (int trial = 0; trial < 200; ++trial) {
    Eigen::Isometry3d X_FL = at({0.2 * u(random), 0.2 * u(random), 0.2 * u(random)});
    X_FL.rotate(Eigen::AngleAxisd(3.0 * u(random), Vector3d(1, -2, 3).normalized()));
    // Every third box holds a sphere's centre: that pair has no direction but the answer's.
    const bool holds_center = trial % 3 == 0;
    const Vector3d middle =
        X_FL * spheres[static_cast<std::size_t>(trial) % spheres.size()].center +
        (holds_center ? 0.0 : 0.3) * Vector3d(u(random), u(random), u(random));
    const Vector3d half = Vector3d::Constant(0.02);
    CloudSnapshot map = test::make_map({Eigen::AlignedBox3d(middle - half, middle + half)});
    const Vector3d direction = Vector3d(u(random), u(random), u(random)).normalized();
    const RepulsiveWrench plain =
        repulsion.wrench(0, X_FL, {&map}, near_by(0.05, direction), config);

    Eigen::Isometry3d X_FG = at({u(random), u(random), u(random)});  // turns the scene
    X_FG.rotate(Eigen::AngleAxisd(3.0 * u(random), Vector3d(-1, 2, 2).normalized()));
    map.X_FM = X_FG;
    const RepulsiveWrench turned =
        repulsion.wrench(0, X_FG * X_FL, {&map}, near_by(0.05, X_FG.linear() * direction), config);
    ASSERT_LT((turned.force - X_FG.linear() * plain.force).norm(), 1e-4) << trial;
    ASSERT_LT((turned.torque - X_FG.linear() * plain.torque).norm(), 1e-4) << trial;
    largest_torque = std::max(largest_torque, plain.torque.norm());
    undirected += holds_center && plain.force.normalized().dot(direction) > 0.5 ? 1 : 0;
  }
  EXPECT_GT(largest_torque, 0.05);
  EXPECT_GT(undirected, 10);
}

}  // namespace
}  // namespace ist
