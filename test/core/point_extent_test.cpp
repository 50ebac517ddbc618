// Points with extent: lower bounds hold for a sphere about each point.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "internal/proximity/deadline.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/cloud/point_extent.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/box_oracle.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// [m] Of float, in points some metres away.
constexpr double kRounding = 3e-6;

using Points = std::vector<Eigen::Vector3d>;
using Poses = std::vector<Eigen::Isometry3d>;
using Snapshots = std::vector<CloudSnapshot>;

// Anything from nothing to radii that grow by a third of the range; the sensor is outside, or among
// the points.
PointExtent random_extent(test::Rng* rng) {
  const auto some = [rng](double largest) {
    const double share = test::uniform(rng, -0.5, 1.0);
    return share > 0.0 ? largest * share * share : 0.0;
  };
  PointExtent extent;
  extent.constant = some(0.05);
  extent.linear = some(0.1);
  extent.quadratic = some(0.04);
  extent.max_range = 3.0;
  extent.p_FS = test::random_vector(rng, test::uniform(rng, 0.0, 1.0) < 0.5 ? 1.0 : 0.1);
  return extent;
}

// [m] What the spheres of all points leave, and what their radii are.
struct SphereTruth {
  double points = kInfinity, spheres = kInfinity;
  double least_radius = kInfinity, largest_radius = 0.0;

  // The least and largest of both.
  void add(const SphereTruth& other) {
    points = std::min(points, other.points);
    spheres = std::min(spheres, other.spheres);
    least_radius = std::min(least_radius, other.least_radius);
    largest_radius = std::max(largest_radius, other.largest_radius);
  }
};

SphereTruth truth_of(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
                     const Snapshots& clouds) {
  SphereTruth truth;
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  for (const CloudSnapshot& cloud : clouds) {
    for (const Eigen::Vector3d& p_F : test::stored_points(cloud.index)) {
      const double distance = test::oracle_signed_distance(link, X_LF * p_F);
      const double r = cloud.extent.radius((p_F - cloud.extent.p_FS).norm());
      truth.add({distance, distance - r, r, r});
    }
  }
  return truth;
}

void expect_spheres(const LinkProximity& result, const SphereTruth& truth,
                    const QueryConfig& config) {
  ASSERT_NE(result.state, LinkState::kUnknown);
  ASSERT_LE(result.lower_bound, truth.spheres + 1e-9);
  if (result.state == LinkState::kClear) {
    ASSERT_EQ(result.lower_bound, config.max_distance);
    ASSERT_GE(truth.spheres, config.max_distance - kRounding);
    return;
  }
  EXPECT_GE(result.sensor_width, 0.0);
  if (std::abs(truth.points) > kRounding) {
    EXPECT_EQ(result.state == LinkState::kContact, truth.points < 0.0);
  }
  EXPECT_LE(result.distance, truth.points + config.tolerance + kRounding);
  EXPECT_GE(result.distance, truth.points - kRounding);
  // As narrow as the tolerance asks; in contact, the largest radius is taken for all.
  const double slack =
      truth.points > kRounding ? 0.0 : truth.largest_radius - truth.least_radius + kRounding;
  EXPECT_GE(result.lower_bound, std::min(truth.spheres, config.max_distance + config.margin) -
                                    config.margin - config.tolerance - slack - kRounding)
      << "distance " << result.distance << ", points " << truth.points << ", sensor "
      << result.sensor_width << ", radii " << truth.least_radius << " to " << truth.largest_radius;
}

std::vector<const CloudSnapshot*> pointers(const Snapshots& clouds) {
  std::vector<const CloudSnapshot*> all;
  for (const CloudSnapshot& cloud : clouds) all.push_back(&cloud);
  return all;
}

struct Counts {
  int cases = 0, clear = 0, near = 0, contact = 0, negative = 0;
  void add(const LinkProximity& result) {
    ++cases;
    clear += result.state == LinkState::kClear ? 1 : 0;
    near += result.state == LinkState::kNear ? 1 : 0;
    contact += result.state == LinkState::kContact ? 1 : 0;
    negative += result.state == LinkState::kNear && result.lower_bound < 0.0 ? 1 : 0;
  }
};

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.001, 0.001, 0.01};
  QueryConfig config;
  config.tolerance = kTolerances[static_cast<std::size_t>(test::uniform(rng, 0, 4))];
  config.max_distance = test::uniform(rng, 0, 1) < 0.5 ? 0.2 : 1.0;
  config.margin = test::uniform(rng, 0, 1) < 0.8 ? 0.0 : 0.01;
  return config;
}

class RandomSpheres : public ::testing::Test {
 protected:
  RandomSpheres() : rng_(191), links_(test::random_links(&rng_)) {
    model_ = test::model_of(links_, 0.01);
  }

  // One to three clouds, some of them points without extent.
  Snapshots random_clouds(std::size_t link, int points) {
    Snapshots clouds;
    const int count = 1 + static_cast<int>(test::uniform(&rng_, 0, 2.5));
    for (int i = 0; i < count; ++i) {
      Points all = test::random_points(&rng_, links_[link], points);
      const Eigen::Vector3d shift = test::random_vector(&rng_, 0.3);
      if (test::uniform(&rng_, 0, 1) < 0.6) {
        for (Eigen::Vector3d& p : all) p += shift;
      }
      clouds.push_back(test::make_snapshot(all, test::random_vector(&rng_, 0.1)));
      if (test::uniform(&rng_, 0, 1) < 0.8) clouds.back().extent = random_extent(&rng_);
    }
    return clouds;
  }

  test::Rng rng_;
  std::vector<LinkGeometry> links_;
  std::shared_ptr<const RobotModel> model_;
};

// Each link against clouds of its own; later poses have warm starts and kept bounds.
TEST_F(RandomSpheres, BoundsHoldAndAreAsNarrowAsTheTolerance) {
  const int wanted = test::scaled(12000);
  ProximityQuery query(model_, {});
  std::vector<LinkProximity> results;
  Counts counts;
  while (counts.cases < wanted) {
    for (std::size_t i = 0; i < links_.size(); ++i) {
      std::vector<bool> known(links_.size(), false);
      known[i] = true;
      const int size = 1 + static_cast<int>(std::pow(test::uniform(&rng_, 0, 1), 3) * 300);
      const Snapshots clouds = random_clouds(i, size);
      Eigen::Isometry3d X_FL = test::random_pose(&rng_, 0.1);
      const QueryConfig config = random_config(&rng_);
      query.set_config(config);
      for (int step = 0; step < 4; ++step) {
        ASSERT_TRUE(query.run(Poses(links_.size(), X_FL), known, pointers(clouds), &results));
        SCOPED_TRACE(::testing::Message() << "case " << counts.cases << ", link " << i << ", "
                                          << size << " points, tolerance " << config.tolerance);
        expect_spheres(results[i], truth_of(links_[i], X_FL, clouds), config);
        counts.add(results[i]);
        X_FL = X_FL * test::random_pose(&rng_, step == 1 ? 0.1 : 0.003);
      }
    }
    if (HasFailure()) return;  // the first is enough
  }
  EXPECT_GT(counts.contact, wanted / 20);
  EXPECT_GT(counts.clear, wanted / 50);
  EXPECT_GT(counts.near, wanted / 4);
  EXPECT_GT(counts.negative, wanted / 100);
}

// The robot's minimum: no sphere is nearer to any link.
TEST_F(RandomSpheres, MinimumOfAllLinks) {
  const int wanted = test::scaled(600);
  ProximityQuery query(model_, {});
  const std::vector<bool> known(links_.size(), true);
  int near = 0;
  for (int scene = 0; 4 * scene < wanted; ++scene) {
    const QueryConfig config = random_config(&rng_);
    query.set_config(config);
    const Snapshots clouds = random_clouds(static_cast<std::size_t>(scene) % links_.size(), 60);
    Poses X_FL(links_.size());
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng_, 0.6);
    for (int step = 0; step < 4; ++step) {
      RobotProximity result;
      ASSERT_TRUE(query.run_minimum(X_FL, known, pointers(clouds), &result));
      SphereTruth truth;
      for (std::size_t i = 0; i < links_.size(); ++i) {
        truth.add(truth_of(links_[i], X_FL[i], clouds));
      }
      SCOPED_TRACE(::testing::Message() << "scene " << scene << ", step " << step);
      expect_spheres(result.nearest, truth, config);
      near += result.nearest.state == LinkState::kNear ? 1 : 0;
      for (Eigen::Isometry3d& X : X_FL) X = X * test::random_pose(&rng_, 0.003);
    }
    if (HasFailure()) return;
  }
  EXPECT_GT(near, wanted / 10);
}

// The nearest point stays what it is without extents, and zero extents change nothing, to the bit.
TEST_F(RandomSpheres, DistanceIsThatOfThePoint) {
  QueryConfig config;
  config.tolerance = 0.0;
  ProximityQuery with(model_, config), without(model_, config), zero(model_, config);
  std::vector<LinkProximity> spheres, points, nothing;
  const std::vector<bool> known(links_.size(), true);
  int compared = 0;
  for (int scene = 0; scene < test::scaled(100); ++scene) {
    const Snapshots clouds = random_clouds(static_cast<std::size_t>(scene) % links_.size(), 80);
    Snapshots bare = clouds;
    for (CloudSnapshot& cloud : bare) cloud.extent = PointExtent();
    Snapshots zeros = bare;
    for (std::size_t k = 0; k < zeros.size(); ++k) zeros[k].extent.p_FS = clouds[k].extent.p_FS;
    Poses X_FL(links_.size());
    for (Eigen::Isometry3d& X : X_FL) X = test::random_pose(&rng_, 0.3);
    ASSERT_TRUE(with.run(X_FL, known, pointers(clouds), &spheres));
    ASSERT_TRUE(without.run(X_FL, known, pointers(bare), &points));
    ASSERT_TRUE(zero.run(X_FL, known, pointers(zeros), &nothing));
    for (std::size_t i = 0; i < links_.size(); ++i) {
      EXPECT_EQ(nothing[i].state, points[i].state);
      EXPECT_EQ(nothing[i].lower_bound, points[i].lower_bound);
      if (points[i].state < LinkState::kNear) continue;
      EXPECT_EQ(nothing[i].distance, points[i].distance);
      EXPECT_EQ(nothing[i].p_FCo, points[i].p_FCo);
      EXPECT_EQ(nothing[i].direction, points[i].direction);
      EXPECT_EQ(nothing[i].sensor_width, 0.0);
      ASSERT_EQ(spheres[i].state, points[i].state);
      EXPECT_NEAR(spheres[i].distance, points[i].distance, kRounding);
      EXPECT_NEAR(spheres[i].lower_bound + spheres[i].sensor_width, points[i].lower_bound,
                  kRounding);
      ++compared;
    }
  }
  EXPECT_GT(compared, test::scaled(500));
}

TEST(BoxExtents, MapIsLargerOnAllSides) {
  test::Rng rng(192);
  const std::vector<TriangleMesh> meshes = {test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 10, 6),
                                            test::box({0.05, 0.1, 0.2})};
  std::vector<Shape> shapes(meshes.begin(), meshes.end());
  QueryConfig config;
  ProximityQuery query(test::make_model(shapes, 0.005), config);
  const std::vector<bool> known(meshes.size(), true);
  std::vector<LinkProximity> results;
  int near = 0;
  for (int scene = 0; scene < test::scaled(60); ++scene) {
    std::vector<Eigen::AlignedBox3d> boxes;
    for (int i = 0; i < 20; ++i) boxes.push_back(test::random_leaf(&rng, 0.6, 0.02, 4));
    // A cloud with varying radii beside the map, so that one of them has to be searched.
    Snapshots clouds = {test::make_map(boxes),
                        test::make_snapshot(test::random_points(&rng, test::one(shapes[0]), 40))};
    clouds[0].box_extent = test::uniform(&rng, 0.0, 0.1);
    clouds[1].extent = random_extent(&rng);
    const Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.3);
    ASSERT_TRUE(query.run(Poses(meshes.size(), X_FL), known, pointers(clouds), &results));
    for (std::size_t i = 0; i < meshes.size(); ++i) {
      if (results[i].state != LinkState::kNear) continue;
      double truth = truth_of(test::one(shapes[i]), X_FL, {clouds[1]}).spheres;
      const test::BoxOracle oracle(meshes[i]);
      for (const Eigen::AlignedBox3d& box : boxes) {
        truth = std::min(truth, oracle.distance({box, X_FL.inverse()}) - clouds[0].box_extent);
      }
      ASSERT_LE(results[i].lower_bound, truth + 1e-9);
      EXPECT_GE(results[i].lower_bound, truth - config.tolerance - kRounding);
      ++near;
    }
  }
  EXPECT_GT(near, test::scaled(20));
}

// The same index with another extent is another scene: nothing that was kept serves it.
TEST(PointExtents, AreAPartOfTheScene) {
  ProximityQuery query(test::make_model({Sphere{0.1}}, 0.001), {});
  CloudSnapshot cloud = test::make_snapshot({{0.0, 0.0, 0.3}, {0.0, 0.0, -0.32}});
  const auto lower_bound = [&] {
    std::vector<LinkProximity> results;
    query.run(Poses(1, Eigen::Isometry3d::Identity()), {true}, {&cloud}, &results);
    EXPECT_NEAR(results[0].distance, 0.2, 1e-6);
    return results[0].lower_bound;
  };
  EXPECT_NEAR(lower_bound(), 0.2, 0.0011);
  cloud.extent.constant = 0.05;
  EXPECT_NEAR(lower_bound(), 0.15, 0.0011);
  cloud.extent.p_FS = {0.0, 0.0, 0.3};  // the sphere of the other point is nearer then
  cloud.extent.linear = 0.1;
  cloud.extent.max_range = 3.0;
  EXPECT_NEAR(lower_bound(), 0.22 - 0.05 - 0.062, 0.0011);
  cloud.extent = PointExtent();
  EXPECT_NEAR(lower_bound(), 0.2, 0.0011);
}

// Points outside the region of interest were discarded, but their spheres count.
TEST(PointExtents, OutsideTheRegionOfInterest) {
  QueryConfig config;
  config.max_distance = 0.5;
  ProximityQuery query(test::make_model({Sphere{0.1}}, 0.001), config);
  CloudSnapshot cloud = test::make_snapshot({{0.0, 0.0, 2.0}});
  cloud.region.center_F.setZero();
  cloud.region.radius = 0.62;  // enough for max_distance and 0.02
  for (const double extent : {0.0, 0.03, 0.01}) {
    cloud.extent.constant = extent;
    std::vector<LinkProximity> results;
    query.run(Poses(1, Eigen::Isometry3d::Identity()), {true}, {&cloud}, &results);
    EXPECT_EQ(results[0].state, extent > 0.02 ? LinkState::kUnknown : LinkState::kClear) << extent;
  }
}

ExtentConfig all_of_it() {
  ExtentConfig config;
  config.noise_constant = 0.001;
  config.noise_quadratic = 0.002;
  config.sigmas = 2.0;
  config.calibration = 0.003;
  config.calibration_angle = 0.004;
  config.latency = 0.02;
  config.speed = 0.5;
  config.footprint = ExtentConfig::Footprint::kAngle;
  config.footprint_angle = 0.005;
  config.incidence = EIGEN_PI / 3.0;
  return config;
}

TEST(ExtentConfig, RadiusIsTheSumOfItsParts) {
  const ExtentConfig config = all_of_it();
  ASSERT_EQ(check_extent(config, 3.0), "");
  const PointExtent extent = point_extent(config, 0.0, 3.0);
  for (const double range : {0.0, 0.5, 3.0}) {
    const double expected = 2.0 * (0.001 + 0.002 * range * range) + 0.003 + 0.004 * range +
                            0.02 * 0.5 + 0.005 * range * std::sqrt(0.5) * 2.0;
    EXPECT_NEAR(extent.radius(range), expected, 1e-12);
  }
  EXPECT_TRUE(ExtentConfig().is_zero());
  EXPECT_FALSE(config.is_zero());
}

// A patch of a plane at the largest incidence, seen by pixels: no point of it is farther from the
// nearest sample than the footprint.
TEST(ExtentConfig, FootprintCoversThePatchBetweenPixels) {
  test::Rng rng(193);
  const double angle = 1.0 / 300.0;
  ExtentConfig config;
  config.footprint = ExtentConfig::Footprint::kCamera;
  const PointExtent extent = point_extent(config, angle, 3.0);
  double largest = 0.0;
  for (int i = 0; i < 2000; ++i) {
    // A plane through (0, 0, z), inclined by at most the incidence in any direction.
    const double z = test::uniform(&rng, 0.3, 2.5), turn = test::uniform(&rng, 0.0, 6.3);
    const double tilt = test::uniform(&rng, 0.0, config.incidence - 0.02);
    const Eigen::Vector3d normal(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn),
                                 -std::cos(tilt));
    const auto sample = [&](double u, double v) {
      const Eigen::Vector3d ray(angle * u, angle * v, 1.0);
      return Eigen::Vector3d(ray * (normal.z() * z / normal.dot(ray)));
    };
    const Eigen::Vector3d p = sample(test::uniform(&rng, 0, 1), test::uniform(&rng, 0, 1));
    double nearest = kInfinity;
    for (const double u : {0.0, 1.0}) {
      for (const double v : {0.0, 1.0}) {
        const double r = extent.radius(sample(u, v).norm());
        nearest = std::min(nearest, (p - sample(u, v)).norm() / r);
      }
    }
    ASSERT_LE(nearest, 1.0);
    largest = std::max(largest, nearest);
  }
  EXPECT_GT(largest, 0.5);
}

TEST(ExtentConfig, WhatMakesNoSenseIsNamed) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  double ExtentConfig::*const members[] = {&ExtentConfig::noise_constant,
                                           &ExtentConfig::noise_quadratic,
                                           &ExtentConfig::sigmas,
                                           &ExtentConfig::calibration,
                                           &ExtentConfig::calibration_angle,
                                           &ExtentConfig::footprint_radius,
                                           &ExtentConfig::footprint_angle,
                                           &ExtentConfig::field_of_view,
                                           &ExtentConfig::incidence,
                                           &ExtentConfig::latency,
                                           &ExtentConfig::speed};
  for (double ExtentConfig::*const member : members) {
    for (const double bad : {-1e-9, kNaN, 1e9, kInfinity}) {
      ExtentConfig config = all_of_it();
      config.*member = bad;
      EXPECT_NE(check_extent(config, 3.0), "");
      IngestConfig ingest;
      ingest.extent = config;
      EXPECT_THROW(Ingest{ingest}, std::invalid_argument);
    }
  }
  // Alone, too: a number that is negative or NaN is not taken for no extent.
  for (const double bad : {-0.1, kNaN}) {
    IngestConfig radius, noise, latency;
    radius.extent.footprint = ExtentConfig::Footprint::kRadius;
    radius.extent.footprint_radius = bad;
    noise.extent.noise_quadratic = bad;
    latency.extent.latency = bad;
    for (const IngestConfig& ingest : {radius, noise, latency}) {
      EXPECT_THROW(Ingest{ingest}, std::invalid_argument);
    }
  }
  ExtentConfig config;
  config.noise_constant = -0.5;
  EXPECT_EQ(check_extent(config, 3.0), "noise_constant is -0.5 m: it must be from 0 to 1 m");
  // Radii without limit.
  EXPECT_NE(check_extent(all_of_it(), kInfinity), "");
  EXPECT_NE(check_extent(all_of_it(), 100.0), "");
  ExtentConfig constant;
  constant.calibration = 0.5;
  EXPECT_EQ(check_extent(constant, kInfinity), "");
  constant.latency = 10.0;
  EXPECT_NE(check_extent(constant, kInfinity), "");
}

// The angle between pixels comes from the message, or the cloud is refused.
TEST(ExtentConfig, FootprintOfACloud) {
  std::vector<Eigen::Vector3d> points(12, Eigen::Vector3d(0.0, 0.0, 1.0));
  RawCloud cloud = packed_cloud(points.data()->data(), 4, 3);
  IngestConfig config;
  config.self_filter = false;
  config.extent.footprint = ExtentConfig::Footprint::kCamera;
  config.extent.incidence = 0.0;
  CloudSnapshot snapshot;
  const auto run = [&] {
    Ingest(config).run(cloud, Eigen::Isometry3d(Eigen::Translation3d(1, 2, 3)), {}, 0.0, &snapshot);
    return snapshot.extent;
  };
  EXPECT_THROW(run(), std::invalid_argument);
  EXPECT_TRUE(snapshot.index.empty());
  config.extent.field_of_view = 0.6;
  EXPECT_NEAR(run().linear, std::sqrt(0.5) * 2.0 * std::tan(0.3) / 3.0, 1e-12);
  EXPECT_EQ(snapshot.extent.p_FS, Eigen::Vector3d(1, 2, 3));
  cloud.pixel_angle = 0.01;  // as a depth image or a scan states it
  EXPECT_NEAR(run().linear, std::sqrt(0.5) * 0.01, 1e-12);
  cloud.pixel_angle = 0.0;
  cloud.width = 12;
  cloud.height = 1;
  cloud.row_step *= 3;
  EXPECT_THROW(run(), std::invalid_argument);
  config.extent.footprint = ExtentConfig::Footprint::kNone;
  EXPECT_TRUE(run().is_zero());
}

// A sensor that moved while it measured: no range is off by more.
TEST(PointExtents, OfASensorThatMoved) {
  PointExtent still;
  still.constant = 0.01;
  still.linear = 0.02;
  still.quadratic = 0.005;
  still.max_range = 4.0;
  PointExtent moved = still;
  moved.allow_for(0.3);
  for (double range = 0.0; range <= 4.0; range += 0.1) {
    EXPECT_GE(moved.radius(std::max(range - 0.3, 0.0)) + 1e-12, still.radius(range));
  }
  EXPECT_EQ(moved.max_range, 4.3);
}

// The published formulas, of depths, at the corner of the image too.
TEST(SensorModels, AreNoLessThanPublished) {
  const auto sigma = [](const char* name, double range) {
    const SensorModel* model = find_sensor_model(name);
    EXPECT_NE(model, nullptr) << name;
    return model == nullptr ? std::nan("")
                            : model->noise_constant + model->noise_quadratic * range * range;
  };
  const double corner =
      std::sqrt(1.0 + std::pow(std::tan(0.4974), 2) + std::pow(std::tan(0.3752), 2));
  for (double z = 0.5; z < 4.0; z += 0.1) {
    for (const double ratio : {1.0, corner}) {
      const double published = 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);
      EXPECT_GE(sigma("kinect_v1", z * ratio), published * ratio - 1e-6);
      EXPECT_LE(sigma("kinect_v1", z * ratio), 2.0 * published * ratio * ratio);
    }
  }
  EXPECT_NEAR(sigma("realsense_d435", 2.0), 4.0 * 0.08 / (424.0 * 0.05), 0.0006);
  EXPECT_GE(sigma("azure_kinect", 2.0), 0.017);
  EXPECT_EQ(find_sensor_model("kinect_v9"), nullptr);
  for (const SensorModel& model : sensor_models()) {
    ExtentConfig config;
    config.noise_constant = model.noise_constant;
    config.noise_quadratic = model.noise_quadratic;
    config.calibration = model.calibration;
    config.calibration_angle = model.calibration_angle;
    config.field_of_view = model.field_of_view;
    EXPECT_EQ(check_extent(config, IngestConfig().max_range), "") << model.name;
  }
}

}  // namespace
}  // namespace ist
