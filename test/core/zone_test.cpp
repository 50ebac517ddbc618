#include "ist_proximity/cloud/zone.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/repulsion/coherent_queries.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "ist_proximity/robot/link_poses.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

using Ids = std::set<std::uint32_t>;
using Points = std::vector<Eigen::Vector3f>;

constexpr double kRounding = 1e-5;  // [m] that a point may be off a zone's surface

// A camera's image of a wavy surface, or points all over a room.
struct Picture {
  Points points;
  std::size_t width = 0;      // 0: a list
  double sensor_moved = 0.0;  // [m]

  RawCloud raw() const {
    const std::size_t columns = width > 0 ? width : points.size();
    RawCloud cloud = packed_cloud(points[0].data(), columns, points.size() / columns);
    cloud.owner = std::shared_ptr<const void>(points.data(), [](const void*) {});
    cloud.sensor_moved = sensor_moved;
    return cloud;
  }
};

Picture image(test::Rng* rng) {
  Picture picture;
  picture.width = 128;
  const double wave = test::uniform(rng, 3.0, 12.0), step = test::uniform(rng, 0.0, 0.5);
  for (int row = 0; row < 96; ++row) {
    for (int column = 0; column < 128; ++column) {
      const double x = (column - 64) / 100.0, y = (row - 48) / 100.0;
      const double z = 1.2 + 0.1 * std::sin(wave * x) + (column > 80 ? step : 0.0);
      picture.points.emplace_back((z * Eigen::Vector3d(x, y, 1.0)).cast<float>());
    }
  }
  return picture;
}

Picture room(test::Rng* rng) {
  Picture picture;
  for (int i = 0; i < 6000; ++i) {
    picture.points.push_back(test::random_vector(rng, 1.5).cast<float>());
  }
  return picture;
}

Zone random_zone(test::Rng* rng, const Eigen::Vector3d& p_FZ) {
  Zone zone;
  const auto length = [rng] { return test::uniform(rng, 0.05, 0.6); };
  switch (std::uniform_int_distribution<int>(0, 2)(*rng)) {
    case 0:
      zone.shape = Box{{length(), length(), length()}};
      break;
    case 1:
      zone.shape = Sphere{length()};
      break;
    default:
      zone.shape = Cylinder{length(), length()};
  }
  zone.X_FZ = test::random_pose(rng, 0.1);
  zone.X_FZ.pretranslate(p_FZ);
  zone.group = std::uniform_int_distribution<std::size_t>(0, 1)(*rng);
  return zone;
}

struct Case {
  Picture picture;
  std::vector<Zone> zones;
  Eigen::Isometry3d X_FS, X_FL;  // of the robot's link
  std::shared_ptr<const RobotModel> robot;
  IngestConfig config;

  CloudSnapshot take_in(std::size_t kept, const std::vector<Zone>& of) const {
    Ingest ingest(config);
    ingest.set_zones(of, kept);
    CloudSnapshot snapshot;
    const std::vector<PosedSolid> links =
        robot ? posed_solids(*robot, {X_FL}, {true}) : std::vector<PosedSolid>();
    for (const double stamp : {1.0, 1.03}) {
      ingest.run(picture.raw(), X_FS, links, stamp, &snapshot);
    }
    return snapshot;
  }
};

// @param robot  of one link, which is partly in the first zone; null: none
Case random_case(test::Rng* rng, bool is_image, bool has_extent,
                 std::shared_ptr<const RobotModel> robot = nullptr) {
  Case one;
  one.picture = is_image ? image(rng) : room(rng);
  one.X_FS = test::random_pose(rng, 3.0);
  one.config.max_range = 100.0;
  one.config.search_distance = 1.0;
  if (has_extent) {
    one.config.extent.noise_constant = 0.002;
    one.config.extent.noise_quadratic = 0.001;
    one.config.extent.max_range = 10.0;
    one.picture.sensor_moved = test::uniform(rng, 0.0, 0.5);
  }
  for (int i = 0; i < 5; ++i) {
    const auto& p = one.picture.points[(*rng)() % one.picture.points.size()];
    one.zones.push_back(random_zone(rng, one.X_FS * p.cast<double>()));
  }
  one.robot = std::move(robot);
  one.X_FL = one.zones[0].X_FZ * Eigen::Translation3d(0.1, 0.0, 0.0);
  return one;
}

// The group of a point by the first zone that holds it; -2 where rounding decides.
constexpr int kOpen = -2, kOutside = -1;
int group_of(const Case& one, std::uint32_t id, const PointExtent& extent) {
  const Eigen::Vector3d p_S = one.picture.points[id].cast<double>();
  const double radius = extent.radius(p_S.norm());
  for (const Zone& zone : one.zones) {
    const double depth = depth_in(zone.shape, zone.X_FZ.inverse() * (one.X_FS * p_S)) - radius;
    if (std::abs(depth) < kRounding) return kOpen;
    if (depth > 0.0) return static_cast<int>(zone.group);
    if (depth > -radius - kRounding) return kOpen;  // its sphere sticks out: it is kept for both
  }
  return kOutside;
}

TEST(Zone, depthIsTheDistanceFromTheSurface) {
  EXPECT_DOUBLE_EQ(depth_in(Box{{1.0, 2.0, 4.0}}, {0.25, 0.9, 0.0}), 0.1);
  EXPECT_DOUBLE_EQ(depth_in(Sphere{0.5}, {0.0, 0.0, 0.75}), -0.25);
  EXPECT_DOUBLE_EQ(depth_in(Cylinder{0.5, 2.0}, {0.25, 0.0, 0.9}), 0.1);
  EXPECT_DOUBLE_EQ(depth_in(Cylinder{0.5, 2.0}, {0.75, 0.0, 0.0}), -0.25);
  EXPECT_EQ(depth_in(TriangleMesh(), {0.0, 0.0, 0.0}), -std::numeric_limits<double>::infinity());
}

TEST(Zone, eachPointIsInTheGroupOfTheFirstZoneThatHoldsIt) {
  const std::shared_ptr<const RobotModel> robot = test::make_model({Box{{0.2, 0.3, 0.4}}}, 0.01);
  std::size_t in_zones = 0, outside = 0, on_robot = 0;
  for (unsigned seed = 1; seed <= 48; ++seed) {
    test::Rng rng(seed);
    const Case one =
        random_case(&rng, seed % 2 == 0, seed % 4 < 2, seed % 3 == 0 ? nullptr : robot);
    SCOPED_TRACE("seed " + std::to_string(seed));
    const CloudSnapshot whole = one.take_in(Zone::kNone, {});
    const CloudSnapshot free = one.take_in(Zone::kNone, one.zones);
    const Ids all = test::ids_of(whole.index), kept = test::ids_of(free.index);
    const Ids groups[] = {test::ids_of(one.take_in(0, one.zones).index),
                          test::ids_of(one.take_in(1, one.zones).index)};
    const IngestCounts& counts = free.counts;
    EXPECT_EQ(counts.in_zones + counts.used + counts.on_robot,
              whole.counts.used + whole.counts.on_robot);
    if (one.picture.sensor_moved > 0.0) {
      PointExtent extent = point_extent(one.config.extent, 0.0, 10.0);
      extent.allow_for(one.picture.sensor_moved);
      EXPECT_DOUBLE_EQ(free.extent.radius(1.0), extent.radius(1.0));
    }
    on_robot += whole.counts.on_robot;
    // The self-filter drops the same.
    for (const Ids* some : {&kept, &groups[0], &groups[1]}) {
      EXPECT_TRUE(std::includes(all.begin(), all.end(), some->begin(), some->end()));
    }
    for (const std::uint32_t id : all) {
      const int group = group_of(one, id, free.extent);
      EXPECT_TRUE(kept.count(id) + groups[0].count(id) + groups[1].count(id) > 0) << id;
      if (group == kOpen) continue;
      EXPECT_EQ(kept.count(id), group == kOutside ? 1U : 0U) << id;
      EXPECT_EQ(groups[0].count(id), group == 0 ? 1U : 0U) << id;
      EXPECT_EQ(groups[1].count(id), group == 1 ? 1U : 0U) << id;
      ++(group == kOutside ? outside : in_zones);
    }
  }
  EXPECT_GT(in_zones, 10000U);
  EXPECT_GT(outside, 10000U);
  EXPECT_GT(on_robot, 1000U);
}

// A zone that names a link hides its points from that link alone.
TEST(Zone, linksThatAreNotNamedSeeItsPoints) {
  const auto model = test::make_model({Box{{0.1, 0.1, 0.1}}, Box{{0.1, 0.1, 0.1}}}, 0.01);
  const std::vector<bool> known = {true, true};
  int differ = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    test::Rng rng(seed);
    Case one = random_case(&rng, seed % 2 == 0, seed % 4 < 2);
    one.zones.resize(1);
    one.zones[0].group = 0;
    SCOPED_TRACE("seed " + std::to_string(seed));
    const CloudSnapshot whole = one.take_in(Zone::kNone, {});
    const CloudSnapshot outside = one.take_in(Zone::kNone, one.zones);
    CloudSnapshot inside = one.take_in(0, one.zones);
    inside.not_for = {model->links[1].name};
    Eigen::Isometry3d X_FL = test::random_pose(&rng, 0.2);
    X_FL.pretranslate(one.zones[0].X_FZ.translation());
    QueryConfig config;
    config.tolerance = 0.0;
    std::vector<LinkProximity> got, all, without;
    CoherentQueries queries(model, config);
    ASSERT_TRUE(queries.query().run({X_FL, X_FL}, known, {&outside, &inside}, &got));
    ASSERT_TRUE(ProximityQuery(model, config).run({X_FL, X_FL}, known, {&whole}, &all));
    ASSERT_TRUE(ProximityQuery(model, config).run({X_FL, X_FL}, known, {&outside}, &without));
    constexpr double kFloat = 1e-5;
    EXPECT_EQ(got[0].state, all[0].state);
    EXPECT_NEAR(got[0].distance, all[0].distance, kFloat);
    EXPECT_LE(got[0].lower_bound, all[0].distance + kFloat);
    EXPECT_EQ(got[1].state, without[1].state);
    if (without[1].state != LinkState::kClear) {
      EXPECT_NEAR(got[1].distance, without[1].distance, kFloat);
      EXPECT_EQ(got[1].source, 0);
    }
    differ += got[0].distance < got[1].distance - 0.01 ? 1 : 0;
    // The same holds for what follows from the distance, and for a second answer.
    ASSERT_EQ(queries.clouds_for(0, {&outside, &inside}).size(), 2U);
    ASSERT_EQ(queries.clouds_for(1, {&outside, &inside}).size(), 1U);
    std::vector<LinkProximity> again;
    ASSERT_TRUE(queries.query().run({X_FL, X_FL}, known, {&outside, &inside}, &again));
    EXPECT_EQ(again[1].distance, got[1].distance);
  }
  EXPECT_GE(differ, 15);
}

}  // namespace
}  // namespace ist
