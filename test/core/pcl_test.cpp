// Clouds of PCL as obstacles, and results as clouds of PCL.
#include "ist_proximity/pcl.h"

#include <gtest/gtest.h>
#include <pcl/conversions.h>
#include <pcl/io/pcd_io.h>
#include <pcl/io/ply_io.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "ist_proximity/facade/robot.h"
#include "support/allocations.h"
#include "support/errors.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/temp_dir.h"

namespace ist {
namespace {

constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();

const Robot& demo() {
  static const Robot robot = [] {
    RobotConfig config;
    config.packing.max_error = test::packed_to(config.packing.max_error);
    config.find_package = [](const std::string&) { return std::string(IST_PROXIMITY_SOURCE_DIR); };
    return Robot(std::string(IST_PROXIMITY_SOURCE_DIR) + "/demo/demo_arm.urdf", config);
  }();
  return robot;
}

std::vector<LinkProximity> answers(const Obstacles& obstacles) {
  QueryConfig exact;
  exact.tolerance = 0.0;
  return demo().distances(std::vector<double>(demo().joints().size(), 0.3), obstacles, exact);
}

std::vector<double> distances(const Obstacles& obstacles) {
  std::vector<double> result;
  for (const LinkProximity& one : answers(obstacles)) result.push_back(one.distance);
  return result;
}

/// An image of random points about the arm, some of them NaN, with intensities.
pcl::PointCloud<pcl::PointXYZI> random_cloud() {
  test::Rng rng(1);
  pcl::PointCloud<pcl::PointXYZI> cloud(40, 30);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const Eigen::Vector3f p =
        (test::random_vector(&rng, 0.9) + Eigen::Vector3d(0, 0, 0.5)).cast<float>();
    cloud[i].x = i % 17 == 0 ? kNaN : p.x();
    cloud[i].y = p.y();
    cloud[i].z = p.z();
    cloud[i].intensity = static_cast<float>(i);
  }
  return cloud;
}

template <class PointT>
pcl::PointCloud<PointT> as(const pcl::PointCloud<pcl::PointXYZI>& cloud) {
  pcl::PointCloud<PointT> result(cloud.width, cloud.height);
  result.sensor_origin_ = cloud.sensor_origin_;
  result.sensor_orientation_ = cloud.sensor_orientation_;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    result[i].x = cloud[i].x;
    result[i].y = cloud[i].y;
    result[i].z = cloud[i].z;
  }
  return result;
}

std::vector<Eigen::Vector3f> list_of(const pcl::PointCloud<pcl::PointXYZI>& cloud) {
  std::vector<Eigen::Vector3f> points;
  for (const pcl::PointXYZI& p : cloud) points.push_back(p.getVector3fMap());
  return points;
}

struct PointInDouble {
  double intensity, z, x, y;
};

// The same points give the same distances, to the bit, whatever they come in.
TEST(Pcl, EveryKindOfCloudGivesTheSameDistances) {
  const pcl::PointCloud<pcl::PointXYZI> cloud = random_cloud();
  const std::vector<double> expected = distances(Obstacles(list_of(cloud)));
  EXPECT_EQ(distances(to_obstacles(cloud)), expected);
  EXPECT_EQ(distances(to_obstacles(cloud.makeShared())), expected);
  EXPECT_EQ(distances(to_obstacles(as<pcl::PointXYZ>(cloud))), expected);
  EXPECT_EQ(distances(to_obstacles(as<pcl::PointXYZRGBNormal>(cloud))), expected);
  pcl::PointCloud<PointInDouble> in_double;
  for (const pcl::PointXYZI& p : cloud) in_double.points.push_back({7.0, p.z, p.x, p.y});
  in_double.width = cloud.width;
  in_double.height = cloud.height;
  EXPECT_EQ(distances(to_obstacles(in_double)), expected);
  pcl::PCLPointCloud2 blob;
  pcl::toPCLPointCloud2(cloud, blob);
  EXPECT_EQ(distances(to_obstacles(blob)), expected);
  EXPECT_EQ(distances(to_obstacles(std::make_shared<pcl::PCLPointCloud2>(blob))), expected);
  blob.is_bigendian = 1;
  for (std::size_t i = 0; i < blob.data.size(); i += 4) {
    std::reverse(&blob.data[i], &blob.data[i] + 4);
  }
  EXPECT_EQ(distances(to_obstacles(blob)), expected);
  const Obstacles obstacles = to_obstacles(cloud);
  EXPECT_EQ(obstacles.counts().received, cloud.size());
  EXPECT_EQ(obstacles.counts().not_a_number, 71U);
}

TEST(Pcl, FilesThatPclWritesGiveTheSameDistances) {
  const test::TempDir folder;
  pcl::PointCloud<pcl::PointXYZI> cloud = random_cloud();
  cloud.sensor_origin_ << 0.25F, -0.5F, 0.125F, 0.0F;
  cloud.sensor_orientation_ = Eigen::Quaternionf(0.5F, 0.5F, -0.5F, 0.5F);
  const std::vector<double> expected = distances(to_obstacles(cloud));
  EXPECT_NE(expected, distances(to_obstacles(random_cloud())));  // the sensor's pose counts
  const std::string path = folder.file("cloud.pcd");
  pcl::PCDWriter pcd;
  ASSERT_EQ(pcd.writeBinary(path, cloud), 0);
  EXPECT_EQ(distances(Obstacles::from_file(path)), expected);
  ASSERT_EQ(pcd.writeBinaryCompressed(path, cloud), 0);
  EXPECT_EQ(distances(Obstacles::from_file(path)), expected);
  constexpr int kAllDigits = 9;
  ASSERT_EQ(pcd.writeASCII(path, cloud, kAllDigits), 0);
  EXPECT_EQ(distances(Obstacles::from_file(path)), expected);
  pcl::PointCloud<pcl::PointXYZI> read;
  ASSERT_EQ(pcl::io::loadPCDFile(path, read), 0);
  EXPECT_EQ(distances(to_obstacles(read)), expected);

  const std::vector<double> unmoved = distances(to_obstacles(random_cloud()));
  const std::string ply = folder.file("cloud.ply");
  pcl::PLYWriter writer;
  for (const bool with_camera : {false, true}) {
    ASSERT_EQ(writer.write(ply, random_cloud(), true, with_camera), 0);
    EXPECT_EQ(distances(Obstacles::from_file(ply)), unmoved);
  }
  // PCL states the sensor's pose as a camera, and forgets it when it reads the file.
  ASSERT_EQ(writer.write(ply, cloud), 0);
  test::expect_says(test::error_of([&] { Obstacles::from_file(ply); }), "not at the origin");
}

// The sensor is 0.2 m behind the origin of the frame in which its pose is stated: a wall 0.5 m
// before it is 0.3 m before that origin.
TEST(Pcl, PointsArePlacedByTheSensorsPose) {
  pcl::PointCloud<pcl::PointXYZ> wall;
  for (int i = -20; i <= 20; ++i) {
    for (int k = -20; k <= 20; ++k) {
      wall.push_back({0.5F, 0.01F * static_cast<float>(i), 0.01F * static_cast<float>(k)});
    }
  }
  wall.sensor_origin_.x() = -0.2F;
  const PclView seen = view(wall);
  EXPECT_FLOAT_EQ(static_cast<float>(seen.X_QS.translation().x()), -0.2F);
  pcl::PCLPointCloud2 blob;
  pcl::toPCLPointCloud2(wall, blob);
  const PclView same = view(blob, wall.sensor_origin_, wall.sensor_orientation_);
  EXPECT_EQ(same.X_QS.matrix(), seen.X_QS.matrix());
  const Robot ball(
      "<robot name='r'><link name='ball'><collision><geometry><sphere radius='0.001'/>"
      "</geometry></collision></link></robot>");
  const auto distance = [&](const Obstacles& obstacles) {
    QueryConfig exact;
    exact.tolerance = 0.0;
    return ball.nearest({}, obstacles, exact).nearest.distance;
  };
  EXPECT_NEAR(distance(to_obstacles(wall)), 0.299, 1e-6);
  const test::TempDir folder;
  const std::string path = folder.file("wall.pcd");
  ASSERT_EQ(pcl::io::savePCDFileBinary(path, wall), 0);
  EXPECT_NEAR(distance(Obstacles::from_file(path)), 0.299, 1e-6);
  ObstaclesConfig near;
  near.max_range = 0.4;  // from the sensor, where the wall is 0.5 m away
  EXPECT_EQ(to_obstacles(wall, near).size(), 0U);
}

TEST(Pcl, AViewCopiesAndAllocatesNothing) {
  const pcl::PointCloud<pcl::PointXYZI> cloud = random_cloud();
  pcl::PCLPointCloud2 blob;
  pcl::toPCLPointCloud2(cloud, blob);
  EXPECT_EQ(view(blob).points.data, blob.data.data());
  const auto shared = cloud.makeShared();
  const PclView kept = view(shared);
  EXPECT_EQ(shared.use_count(), 2);
  IngestConfig config;
  config.self_filter = false;
  Ingest ingest(config);
  CloudSnapshot snapshot;
  const auto take = [&] {
    ingest.run(view(cloud).points, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot);
    ingest.run(view(blob).points, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot);
  };
  for (int i = 0; i < 3; ++i) take();
  const long before = test::allocations;
  take();
  EXPECT_EQ(test::allocations - before, 0);
}

TEST(Pcl, ACloudThatContradictsItselfIsRefused) {
  pcl::PointCloud<pcl::PointXYZ> cloud(3, 2);
  cloud.points.pop_back();
  test::expect_says(test::argument_error([&] { view(cloud); }), "5 points has width 3 * height 2");
  cloud.width = cloud.height = 65537;
  cloud.points.resize(131073);  // the product, but for 2^32
  test::expect_says(test::argument_error([&] { view(cloud); }), "width 65537");
  cloud = pcl::PointCloud<pcl::PointXYZ>(3, 2);
  cloud.sensor_orientation_ = Eigen::Quaternionf(0, 0, 0, 0);
  test::expect_says(test::argument_error([&] { view(cloud); }), "sensor_orientation_");
  cloud.sensor_orientation_.setIdentity();
  cloud.sensor_origin_.x() = kNaN;
  test::expect_says(test::argument_error([&] { view(cloud); }), "sensor_origin_");
  const pcl::PointCloud<pcl::PointXYZ>::ConstPtr none;
  test::expect_says(test::argument_error([&] { view(none); }), "null");
  for (auto& p : cloud) p.x = kNaN;
  cloud.sensor_origin_.setZero();
  test::expect_says(test::argument_error([&] { to_obstacles(cloud); }), "none was measured");
  EXPECT_EQ(to_obstacles(pcl::PointCloud<pcl::PointXYZ>()).size(), 0U);

  pcl::PCLPointCloud2 whole;
  pcl::toPCLPointCloud2(random_cloud(), whole);
  const auto spoiled = [&](const std::function<void(pcl::PCLPointCloud2*)>& spoil) {
    pcl::PCLPointCloud2 blob = whole;
    spoil(&blob);
    return test::argument_error([&] { view(blob); });
  };
  using Blob = pcl::PCLPointCloud2;
  test::expect_says(spoiled([](Blob* b) { b->data.pop_back(); }), "data holds");
  test::expect_says(spoiled([](Blob* b) { b->fields[2].name = "depth"; }), "'z'");
  test::expect_says(spoiled([](Blob* b) { b->fields[0].datatype = 5; }), "'x'");
  test::expect_says(spoiled([](Blob* b) { b->width = 4000000000U; }), "row_step");
}

// Points come back with all their fields, in the cloud's own frame.
TEST(Pcl, ResultsAreCloudsOfPcl) {
  const pcl::PointCloud<pcl::PointXYZI> cloud = random_cloud();
  ObstaclesConfig config;
  config.robot = &demo();
  config.q.assign(demo().joints().size(), 0.3);
  config.self_filter_padding = 0.1;
  config.max_range = 1.0;
  const Obstacles obstacles = to_obstacles(cloud, config);
  const auto used = used_points(cloud, obstacles), robot = points_on_robot(cloud, config);
  ASSERT_EQ(used.size(), obstacles.size());
  ASSERT_EQ(robot.size(), obstacles.counts().on_robot);
  ASSERT_GT(robot.size(), 0U);
  for (const auto* some : {&used, &robot}) {
    EXPECT_EQ(some->width, some->size());
    for (const pcl::PointXYZI& p : *some) {
      EXPECT_EQ(p.x, cloud[static_cast<std::size_t>(p.intensity)].x);
      EXPECT_LE(p.getVector3fMap().norm(), 1.0F);
    }
  }
  const std::vector<LinkProximity> links = answers(obstacles);
  const pcl::PointCloud<pcl::PointXYZ> witnesses = witness_points(links);
  ASSERT_EQ(witnesses.height, 2U);
  std::size_t i = 0;
  for (const LinkProximity& link : links) {
    if (link.state != LinkState::kNear && link.state != LinkState::kContact) continue;
    const auto on_link = witnesses.at(static_cast<int>(i), 0).getVector3fMap(),
               on_obstacle = witnesses.at(static_cast<int>(i), 1).getVector3fMap();
    EXPECT_NEAR((on_link - on_obstacle).norm(), std::abs(link.distance), 1e-5);
    ++i;
  }
  EXPECT_EQ(witnesses.width, i);
  EXPECT_GT(i, 0U);
}

}  // namespace
}  // namespace ist
