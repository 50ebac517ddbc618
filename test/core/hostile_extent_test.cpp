// Points with extent under attack: the largest radii and steepest growths that are allowed, several
// clouds of different sensors, and ranges, margins and tolerances that change from pose to pose.

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
#include "support/random_links.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/shape_oracle.h"
#include "support/trial.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kRounding = 3e-6;  // [m] of float

using Points = std::vector<Eigen::Vector3d>;
using Poses = std::vector<Eigen::Isometry3d>;

// Up to a radius of 1 m, and a growth of half a metre for each metre.
PointExtent extreme_extent(test::Rng* rng) {
  const auto uniform = [rng](double low, double high) { return test::uniform(rng, low, high); };
  PointExtent extent;
  extent.max_range = uniform(0.5, 4.0);
  double growth = uniform(0.0, 1.0) < 0.3 ? 0.0 : uniform(0.0, kMaxExtentGrowth);
  const double share = uniform(0.0, 1.0) < 0.5 ? 1.0 : uniform(0.0, 1.0);
  extent.linear = growth * share;
  extent.quadratic = growth * (1.0 - share) / (2.0 * extent.max_range);
  const double largest = extent.radius(extent.max_range);
  if (largest > kMaxExtent) {
    extent.linear *= kMaxExtent / largest;
    extent.quadratic *= kMaxExtent / largest;
  } else if (uniform(0.0, 1.0) < 0.5) {
    extent.constant = (kMaxExtent - largest) * std::pow(uniform(0.0, 1.0), 4);
  }
  extent.p_FS = test::random_vector(rng, uniform(0.0, 1.0) < 0.5 ? 1.5 : 0.2);
  return extent;
}

struct Cloud {
  Points points;
  CloudSnapshot snapshot;
};

Cloud random_cloud(test::Rng* rng, const LinkGeometry& link, int count) {
  Cloud cloud;
  const PointExtent extent = extreme_extent(rng);
  const Eigen::Vector3d shift = test::random_vector(rng, test::uniform(rng, 0.0, 2.0));
  for (const Eigen::Vector3d& p : test::random_points(rng, link, count)) {
    const Eigen::Vector3d q = p + shift;
    if ((q - extent.p_FS).norm() < 0.999 * extent.max_range) cloud.points.push_back(q);
  }
  cloud.snapshot = test::make_snapshot(cloud.points, test::random_vector(rng, 0.1));
  cloud.snapshot.extent = extent;
  return cloud;
}

std::vector<Cloud> random_clouds(test::Rng* rng, const LinkGeometry& link) {
  std::vector<Cloud> clouds;
  const int count = 1 + static_cast<int>(test::uniform(rng, 0, 3.5));
  for (int k = 0; k < count; ++k) {
    const int size = 1 + static_cast<int>(std::pow(test::uniform(rng, 0, 1), 3) * 100);
    clouds.push_back(random_cloud(rng, link, size));
  }
  return clouds;
}

double truth_of(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
                const std::vector<Cloud>& clouds) {
  double truth = kInfinity;
  const Eigen::Isometry3d X_LF = X_FL.inverse();
  for (const Cloud& cloud : clouds) {
    for (const Eigen::Vector3d& p_F : test::stored_points(cloud.snapshot.index)) {
      const PointExtent& extent = cloud.snapshot.extent;
      truth = std::min(truth, test::oracle_signed_distance(link, X_LF * p_F) -
                                  extent.radius((p_F - extent.p_FS).norm()));
    }
  }
  return truth;
}

QueryConfig random_config(test::Rng* rng) {
  constexpr double kTolerances[] = {0.0, 0.001, 0.01, 0.1};
  QueryConfig config;
  config.tolerance = kTolerances[static_cast<std::size_t>(test::uniform(rng, 0, 3.99))];
  config.relative_tolerance = test::uniform(rng, 0, 1) < 0.7 ? 0.0 : 0.2;
  config.max_distance = std::pow(10.0, test::uniform(rng, -2.0, 0.5));
  config.margin = test::uniform(rng, 0, 1) < 0.7 ? 0.0 : test::uniform(rng, 0.0, 0.3);
  return config;
}

// No bound is above the truth, whatever was kept from poses with another range.
TEST(HostileExtent, NoBoundIsAboveTheSpheres) {
  test::Rng rng(20251);
  const std::vector<LinkGeometry> links = test::random_links(&rng);
  const auto model = test::model_of(links, 0.01);
  const int wanted = test::scaled(6000);
  std::vector<LinkProximity> results;
  int cases = 0, clear = 0, near = 0;
  while (cases < wanted) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      std::vector<bool> known(links.size(), false);
      known[i] = true;
      const std::vector<Cloud> clouds = random_clouds(&rng, links[i]);
      std::vector<const CloudSnapshot*> all;
      for (const Cloud& cloud : clouds) all.push_back(&cloud.snapshot);
      ProximityQuery query(model, {});
      Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.5);
      for (int step = 0; step < 8; ++step) {
        QueryConfig config = random_config(&rng);
        const bool has_deadline = step % 4 == 3;
        if (has_deadline) {
          config.deadline = 1.0;
          Deadline::asks_left_for_test = static_cast<int>(test::uniform(&rng, 0, 12));
        }
        query.set_config(config);
        const bool complete = query.run(Poses(links.size(), X_FL), known, all, &results);
        Deadline::asks_left_for_test = -1;
        ASSERT_TRUE(complete || has_deadline);
        const LinkProximity& result = results[i];
        const double truth = truth_of(links[i], X_FL, clouds);
        SCOPED_TRACE(::testing::Message()
                     << "case " << cases << ", link " << i << ", step " << step << ", "
                     << clouds.size() << " clouds, max_distance " << config.max_distance
                     << ", margin " << config.margin << ", tolerance " << config.tolerance);
        ASSERT_LE(result.lower_bound, truth - config.margin + 1e-9);
        if (result.state == LinkState::kClear) {
          ASSERT_GE(truth - config.margin, config.max_distance - kRounding);
        }
        ++cases;
        clear += result.state == LinkState::kClear ? 1 : 0;
        near += result.state == LinkState::kNear ? 1 : 0;
        X_FL = X_FL * test::random_pose(&rng, std::pow(10.0, test::uniform(&rng, -5.0, -0.5)));
      }
    }
  }
  EXPECT_GT(clear, wanted / 50);
  EXPECT_GT(near, wanted / 10);
}

// The nearest point of all is out of range, a sphere about another link's point is in it. The
// answer for the nearest link was CLEAR.
TEST(HostileExtent, TheNearestLinkIsThatOfASphereInRange) {
  const auto model = test::make_model({Sphere{0.1}, Sphere{0.1}}, 0.005);
  Poses X_FL(2, Eigen::Isometry3d::Identity());
  X_FL[1].translation().x() = 10.0;
  std::vector<CloudSnapshot> clouds = {test::make_snapshot({{0.0, 1.3, 0.0}}),
                                       test::make_snapshot({{10.0, 1.6, 0.0}})};
  clouds[1].extent.constant = 0.8;
  clouds[1].extent.max_range = 20.0;
  QueryConfig config;
  config.max_distance = 1.0;
  ProximityQuery query(model, config);
  for (int again = 0; again < 3; ++again) {
    RobotProximity found;
    ASSERT_TRUE(query.run_minimum(X_FL, {true, true}, {&clouds[0], &clouds[1]}, &found));
    EXPECT_EQ(found.nearest.state, LinkState::kNear);
    EXPECT_EQ(found.link, 1);
    EXPECT_NEAR(found.nearest.lower_bound, 0.7, config.tolerance + 1e-6);
  }
}

// A deadline that ends the search of one cloud leaves the other one: its sphere is the nearest one,
// though its point is not. Bounds were up to 0.22 m above the truth.
TEST(HostileExtent, ADeadlineLeavesNoCloudOut) {
  test::Rng rng(20252);
  const std::vector<Shape> shapes = {Box{{0.2, 0.1, 0.3}}};
  const auto model = test::make_model(shapes, 0.005);
  int unfinished = 0;
  for (int scene = 0; scene < 20; ++scene) {
    std::vector<Cloud> clouds(2);
    for (int i = 0; i < 600; ++i) {
      const double range = test::uniform(&rng, 0.8, 1.2);
      clouds[0].points.push_back(range * test::random_vector(&rng, 1.0).normalized());
    }
    clouds[1].points = {1.3 * test::random_vector(&rng, 1.0).normalized()};
    for (Cloud& cloud : clouds) {
      cloud.snapshot = test::make_snapshot(cloud.points);
      cloud.snapshot.extent.p_FS = test::random_vector(&rng, 0.3);
      cloud.snapshot.extent.max_range = 3.0;
    }
    clouds[0].snapshot.extent.linear = 0.2;
    clouds[1].snapshot.extent.constant = 0.8;
    const double truth = truth_of(test::one(shapes[0]), Eigen::Isometry3d::Identity(), clouds);
    QueryConfig config;
    config.deadline = 3600.0;
    config.max_distance = 2.0;
    for (int asks = 0; asks < 120; ++asks) {
      ProximityQuery query(model, config);
      const Poses X_FL = {Eigen::Isometry3d::Identity()};
      std::vector<LinkProximity> results;
      RobotProximity nearest;
      for (const bool is_minimum : {false, true}) {
        Deadline::asks_left_for_test = asks;
        const std::vector<const CloudSnapshot*> all = {&clouds[0].snapshot, &clouds[1].snapshot};
        const bool is_whole = is_minimum ? query.run_minimum(X_FL, {true}, all, &nearest)
                                         : query.run(X_FL, {true}, all, &results);
        Deadline::asks_left_for_test = -1;
        unfinished += is_whole ? 0 : 1;
        const LinkProximity& found = is_minimum ? nearest.nearest : results[0];
        ASSERT_LE(found.lower_bound, truth + 1e-9) << scene << ", " << asks << ", " << is_minimum;
      }
    }
  }
  EXPECT_GT(unfinished, 100);
}

// A bound holds for spheres that are nearer than the range of its query. Of a cloud that is not
// searched, because no sphere of it matters within that range, larger spheres may be farther out:
// B's at 1.14 m, where its largest radius within 1 m says 1.165 m. The next pose is 0.2 m nearer.
TEST(HostileExtent, WhatIsKeptHoldsBeyondTheRangeThatItWasFoundFor) {
  const std::vector<Shape> shapes = {Sphere{0.1}};
  const auto model = test::make_model(shapes, 0.005);
  std::vector<Cloud> clouds(3);
  clouds[0].points = {{-1.9, 0.0, 0.0}};
  clouds[1].points = {{1.55, 0.0, 0.0}};
  clouds[2].points = {{1.54, 0.01, 0.0}};  // the nearest point has no extent
  for (Cloud& cloud : clouds) {
    cloud.snapshot = test::make_snapshot(cloud.points, Eigen::Vector3d::Zero());
    cloud.snapshot.extent.max_range = 3.0;
  }
  clouds[0].snapshot.extent.constant = 0.5;
  clouds[1].snapshot.extent.linear = 0.2;
  std::vector<const CloudSnapshot*> all;
  for (const Cloud& cloud : clouds) all.push_back(&cloud.snapshot);
  QueryConfig config;
  config.max_distance = 1.0;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
  for (const double x : {0.0, 0.2}) {
    X_FL.translation().x() = x;
    ASSERT_TRUE(query.run(Poses{X_FL}, {true}, all, &results));
    EXPECT_LE(results[0].lower_bound, truth_of(test::one(shapes[0]), X_FL, clouds) + 1e-9) << x;
  }
}

// The same of a map's boxes, of which one is measured and proves no more than the range, because
// the spheres of a coarse link say too little of it.
TEST(HostileExtent, WhatIsKeptOfABoxHoldsBeyondTheRange) {
  const std::vector<Shape> shapes = {Box{{0.2, 0.2, 0.2}}};
  const auto model = test::make_model(shapes, 0.05);
  QueryConfig config;
  config.max_distance = 1.0;
  std::vector<LinkProximity> results;
  for (int i = 1; i < 80; ++i) {
    const double distance = 1.45 + 0.001 * i;
    std::vector<CloudSnapshot> clouds = {
        test::make_map({Eigen::AlignedBox3d(Eigen::Vector3d(0.1 + distance, -0.1, -0.1),
                                            Eigen::Vector3d(0.2 + distance, 0.1, 0.1))}),
        test::make_snapshot({{-1.5, 0.0, 0.0}}, Eigen::Vector3d::Zero())};
    clouds[0].box_extent = 0.45;
    ProximityQuery query(model, config);
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    for (const double x : {0.0, 0.2}) {
      X_FL.translation().x() = x;
      ASSERT_TRUE(query.run(Poses{X_FL}, {true}, {&clouds[0], &clouds[1]}, &results));
      ASSERT_LE(results[0].lower_bound, distance - x - clouds[0].box_extent + 1e-6)
          << distance << ", " << x;
    }
  }
}

// The same where the nearest point, which has no extent, is another one at both poses, so that
// nothing but the bound that is kept says how near the box is.
TEST(HostileExtent, WhatIsKeptOfABoxHoldsWhereAPointIsNearer) {
  const auto model = test::make_model({Box{{0.2, 0.2, 0.2}}}, 0.05);
  QueryConfig config;
  config.max_distance = 1.0;
  std::vector<LinkProximity> results;
  const CloudSnapshot point = test::make_snapshot({{0.0, 1.44, 0.0}}, Eigen::Vector3d::Zero());
  for (int i = 1; i < 80; ++i) {
    const double distance = 1.45 + 0.001 * i;
    CloudSnapshot map = test::make_map({Eigen::AlignedBox3d(
        Eigen::Vector3d(0.1 + distance, -0.1, -0.1), Eigen::Vector3d(0.2 + distance, 0.1, 0.1))});
    map.box_extent = 0.45;
    ProximityQuery query(model, config);
    Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity();
    for (const double x : {0.0, 0.1}) {
      X_FL.translation().x() = x;
      ASSERT_TRUE(query.run(Poses{X_FL}, {true}, {&map, &point}, &results));
      ASSERT_LE(results[0].lower_bound, distance - x - map.box_extent + 1e-6)
          << distance << ", " << x;
    }
  }
}

// The bounds that a search of spheres keeps are those of its radii: after them, a cloud and a map
// stay the same with other ones, and the nearest obstacle has none. Bounds were up to 0.15 m above
// the truth.
TEST(HostileExtent, WhatASearchKeepsIsOfItsRadii) {
  const auto model = test::make_model({Sphere{0.05}}, 0.005);
  QueryConfig config;
  config.tolerance = 0.0;
  const CloudSnapshot nearest = test::make_snapshot({{0.25, 0.0, 0.0}});
  CloudSnapshot spheres = test::make_snapshot({{-0.3, 0.0, 0.0}, {-0.31, 0.0, 0.0}});
  spheres.extent.max_range = 10.0;
  CloudSnapshot map = test::make_map({Eigen::AlignedBox3d(Eigen::Vector3d(-0.31, -0.001, -0.001),
                                                          Eigen::Vector3d(-0.3, 0.001, 0.001))});
  std::vector<LinkProximity> results;
  for (const CloudSnapshot* one : {&spheres, &map}) {
    ProximityQuery query(model, config);
    for (const double radius : {0.04, 0.1, 0.2, 0.04}) {
      spheres.extent.constant = map.box_extent = radius;
      ASSERT_TRUE(
          query.run(Poses{Eigen::Isometry3d::Identity()}, {true}, {&nearest, one}, &results));
      EXPECT_NEAR(results[0].lower_bound, std::min(0.2, 0.25 - radius), 1e-6) << radius;
    }
  }
}

// The angle of a pixel is known with the first message. A few very wide pixels before a short range
// make radii that are small enough, and grow faster than the range: no bound could hold then.
TEST(HostileExtent, AFootprintThatGrowsTooFastIsRefused) {
  const float points[] = {0.0F, 0.0F, 0.2F, 0.1F, 0.0F, 0.2F};
  RawCloud raw = packed_cloud(points, 2, 1);
  IngestConfig config;
  config.extent.footprint = ExtentConfig::Footprint::kCamera;
  CloudSnapshot snapshot;
  for (const double max_range : {0.3, 1.0}) {
    config.max_range = max_range;
    Ingest ingest(config);
    raw.pixel_angle = 0.3;  // a growth of 0.42
    EXPECT_NO_THROW(ingest.run(raw, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot));
    EXPECT_LE(snapshot.extent.linear, kMaxExtentGrowth);
    for (const double angle : {0.4, 2.0, 1e6, kInfinity}) {
      raw.pixel_angle = angle;
      EXPECT_THROW(ingest.run(raw, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot),
                   std::invalid_argument)
          << max_range << " m, " << angle << " rad";
    }
  }
}

}  // namespace
}  // namespace ist
