// Depth images as a source, against the cloud that is made of the same image in double.

#include "ist_proximity/cloud/depth_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/proximity/proximity_query.h"
#include "support/errors.h"
#include "support/scene.h"
#include "support/tiles.h"
#include "support/whole_cloud.h"

namespace ist {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

CameraModel camera_of(std::uint32_t width, std::uint32_t height) {
  CameraModel camera;
  camera.width = width;
  camera.height = height;
  const double f = 0.83 * width;
  camera.P = {f, 0, 0.49 * width, 0, 0, 1.01 * f, 0.52 * height, 0, 0, 0, 1, 0};
  camera.K = {2 * f, 0, 1, 0, 2 * f, 1, 0, 0, 1};  // P is what counts
  return camera;
}

struct Format {
  const char* encoding = "16UC1";
  bool is_bigendian = false;
  std::size_t padding = 0, misaligned = 0;
  bool is_float() const { return std::string(encoding) == "32FC1"; }
};

const std::vector<Format> kFormats = {{"16UC1"}, {"16UC1", true},       {"mono16", false, 3, 1},
                                      {"32FC1"}, {"32FC1", true, 5, 1}, {"32FC1", false, 16}};

// A depth image's bytes, checked as the node checks them.
class Message {
 public:
  // @param depths  [m] by pixel
  Message(const std::vector<double>& depths, std::uint32_t width, const CameraModel& camera,
          const Format& format) {
    const std::size_t pixel = format.is_float() ? 4 : 2;
    image.encoding = format.encoding;
    image.width = width;
    image.height = static_cast<std::uint32_t>(depths.size() / width);
    image.step = static_cast<std::uint32_t>(width * pixel + format.padding);
    image.is_bigendian = format.is_bigendian;
    bytes_->assign(format.misaligned + std::size_t{image.height} * image.step, 0xAB);
    for (std::size_t i = 0; i < depths.size(); ++i) {
      std::uint8_t* to =
          bytes_->data() + format.misaligned + i / width * image.step + i % width * pixel;
      if (format.is_float()) {
        const auto value = static_cast<float>(depths[i]);
        std::memcpy(to, &value, pixel);
      } else {
        const auto value =
            static_cast<std::uint16_t>(depths[i] > 0.0 ? std::lround(1000.0 * depths[i]) : 0);
        std::memcpy(to, &value, pixel);
      }
      if (format.is_bigendian) std::reverse(to, to + pixel);
    }
    image.data = bytes_->data() + format.misaligned;
    image.data_size = bytes_->size() - format.misaligned;
    EXPECT_EQ(check_camera(camera, &rays), "");
    EXPECT_EQ(check_depth_image(image, rays, &raw), "");
    raw.owner = bytes_;
  }

  DepthImage image;
  std::shared_ptr<const DepthRays> rays;
  RawCloud raw;

 private:
  std::shared_ptr<std::vector<std::uint8_t>> bytes_ = std::make_shared<std::vector<std::uint8_t>>();
};

CloudSnapshot ingested(const Message& message, const IngestConfig& config = {}) {
  CloudSnapshot snapshot;
  Ingest(config).run(message.raw, Eigen::Isometry3d::Identity(), {}, 0.0, &snapshot);
  return snapshot;
}

// The cloud that is made of the image in double, by the pinhole's formula.
class PeerCloud {
 public:
  PeerCloud(const std::vector<double>& depths, std::uint32_t width, const CameraModel& camera,
            const Format& format) {
    for (std::size_t i = 0; i < depths.size(); ++i) {
      double z = format.is_float() ? static_cast<double>(static_cast<float>(depths[i]))
                                   : std::round(1000.0 * depths[i]) / 1000.0;
      if (!(z > 0.0)) z = kNan;
      const auto u = static_cast<double>(i % width), v = static_cast<double>(i / width);
      Eigen::Vector3d p(((u - camera.P[2]) * z - camera.P[3]) / camera.P[0],
                        ((v - camera.P[6]) * z - camera.P[7]) / camera.P[5], z);
      if (std::isinf(z)) p.setConstant(kInf);
      points.push_back(p);
    }
    raw = packed_cloud(points.data()->data(), width, points.size() / width);
  }

  std::vector<Eigen::Vector3d> points;
  RawCloud raw;
};

// A wall, a board in front of it and some pixels that saw nothing.
std::vector<double> scene_depths(std::uint32_t width, std::uint32_t height, test::Rng* rng) {
  std::vector<double> depths;
  const double board = test::uniform(rng, 0.5, 0.7);
  for (std::uint32_t v = 0; v < height; ++v) {
    for (std::uint32_t u = 0; u < width; ++u) {
      const double wall = 0.9 + 0.3 * u / width + test::uniform(rng, 0.0, 0.003);
      double depth = u > width / 2 && v < 2 * height / 3 ? board : wall;
      if ((*rng)() % 200 == 0) depth = 0.0;
      depths.push_back(depth);
    }
  }
  return depths;
}

void expect_same_counts(const IngestCounts& a, const IngestCounts& b) {
  EXPECT_EQ(a.received, b.received);
  EXPECT_EQ(a.not_a_number, b.not_a_number);
  EXPECT_EQ(a.infinite, b.infinite);
  EXPECT_EQ(a.out_of_range, b.out_of_range);
  EXPECT_EQ(a.outside_region, b.outside_region);
  EXPECT_EQ(a.on_robot, b.on_robot);
  EXPECT_EQ(a.used, b.used);
}

// Every encoding and byte order; sizes that fill blocks of 16 x 16 pixels and sizes that do not;
// one that is too small to be organized; range limits and a region that cut through the picture.
TEST(DepthImage, PointsAreThoseOfTheCloud) {
  test::Rng rng(5);
  const std::uint32_t sizes[][2] = {{64, 48}, {75, 53}, {9, 31}, {1, 40}};
  for (const Format& format : kFormats) {
    for (const auto& [width, height] : sizes) {
      for (const bool thin : {false, true}) {
        SCOPED_TRACE(std::string(format.encoding) + " " + std::to_string(width) +
                     (thin ? " thinned" : ""));
        const CameraModel camera = camera_of(width, height);
        const std::vector<double> depths = scene_depths(width, height, &rng);
        const Message message(depths, width, camera, format);
        const PeerCloud peer(depths, width, camera, format);
        const Eigen::Isometry3d X_FS = test::random_pose(&rng, 1.0);
        IngestConfig config;
        config.thin = thin;
        config.min_range = 0.6;
        config.max_range = 1.3;
        Ingest ingest(config);
        ingest.set_region_of_interest({X_FS * Eigen::Vector3d(0.1, 0.0, 0.9), 0.7});
        CloudSnapshot ours, theirs;
        ingest.run(message.raw, X_FS, {}, 0.0, &ours);
        ingest.run(peer.raw, X_FS, {}, 0.0, &theirs);
        expect_same_counts(ours.counts, theirs.counts);
        EXPECT_GT(ours.counts.used, 0U);
        const auto ours_by_id = test::points_by_id(ours.index);
        for (const auto& [id, p] : test::points_by_id(theirs.index)) {
          ASSERT_EQ(ours_by_id.count(id), 1U) << id;
          EXPECT_LT((ours_by_id.at(id) - p).norm(), 2e-7) << id;
        }
      }
    }
  }
}

// REP 117 and 118: 0, NaN, -inf and what is behind the camera are not known; +inf is a measurement
// of nothing. A wall of +inf must not look like a blind sensor, nor a blind sensor like free space.
TEST(DepthImage, UnknownAndNothing) {
  const std::uint32_t width = 32, height = 16;
  const CameraModel camera = camera_of(width, height);
  for (const double unknown : {0.0, -0.0, kNan, -kInf, -1.0}) {
    const std::vector<double> depths(std::size_t{width} * height, unknown);
    const IngestCounts counts = ingested({depths, width, camera, {"32FC1"}}).counts;
    EXPECT_TRUE(counts.saw_nothing()) << unknown;
    EXPECT_EQ(counts.not_a_number, depths.size()) << unknown;
  }
  const std::vector<double> depths(std::size_t{width} * height, kInf);
  const IngestCounts counts = ingested({depths, width, camera, {"32FC1"}}).counts;
  EXPECT_FALSE(counts.saw_nothing());
  EXPECT_EQ(counts.infinite, depths.size());
  EXPECT_EQ(counts.used, 0U);
}

// P projects a point as sensor_msgs/CameraInfo states, whatever its baseline.
TEST(DepthImage, BaselineOfP) {
  const std::uint32_t width = 32, height = 16;
  CameraModel camera = camera_of(width, height);
  camera.P[3] = -0.07 * camera.P[0];
  camera.P[7] = 0.02 * camera.P[5];
  test::Rng rng(9);
  std::vector<double> depths;
  for (std::size_t i = 0; i < std::size_t{width} * height; ++i) {
    depths.push_back(test::uniform(&rng, 0.5, 2.0));
  }
  const Message message(depths, width, camera, {"32FC1"});
  const CloudSnapshot snapshot = ingested(message);
  const auto points = test::points_by_id(snapshot.index);
  ASSERT_EQ(points.size(), depths.size());
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> P(camera.P.data());
  for (const auto& [id, p] : points) {
    const Eigen::Vector3d uvw = P * p.homogeneous();
    EXPECT_NEAR(uvw.x() / uvw.z(), id % width, 1e-4);
    EXPECT_NEAR(uvw.y() / uvw.z(), id / width, 1e-4);
  }
}

// The unit of an image replaces that of its encoding.
TEST(DepthImage, Unit) {
  const CameraModel camera = camera_of(8, 4);
  for (const auto& [encoding, number, unit] :
       {std::tuple{"16UC1", 1.4, 1e-4}, std::tuple{"32FC1", 1400.0, 1e-3}}) {
    Message message(std::vector<double>(32, number), 8, camera, {encoding});
    message.image.unit = unit;
    ASSERT_EQ(check_depth_image(message.image, message.rays, &message.raw), "");
    const CloudSnapshot snapshot = ingested(message, test::whole_cloud(false));
    const double z = test::points_by_id(snapshot.index).at(0).z();
    EXPECT_NEAR(z, encoding == std::string("16UC1") ? 0.14 : 1.4, 1e-6);
  }
  Message message(std::vector<double>(32, 1.0), 8, camera, {"16UC1"});
  for (const double unit : {-1.0, kNan, kInf}) {
    message.image.unit = unit;
    test::expect_says(check_depth_image(message.image, message.rays, &message.raw), "unit is");
  }
}

// The same scene, seen by the whole sensor, by a region of it and with pixels put together.
TEST(DepthImage, RegionAndBinning) {
  CameraModel camera = camera_of(64, 48);
  std::shared_ptr<const DepthRays> whole, part;
  ASSERT_EQ(check_camera(camera, &whole), "");
  EXPECT_EQ(whole->x.size(), 64U);
  EXPECT_EQ(whole->y.size(), 48U);
  EXPECT_DOUBLE_EQ(whole->x[10], (10.0 - camera.P[2]) / camera.P[0]);
  EXPECT_DOUBLE_EQ(whole->y[20], (20.0 - camera.P[6]) / camera.P[5]);
  camera.roi_x_offset = 8;
  camera.roi_y_offset = 4;
  camera.roi_width = 40;
  camera.roi_height = 20;
  camera.binning_x = 2;
  camera.binning_y = 4;
  ASSERT_EQ(check_camera(camera, &part), "");
  ASSERT_EQ(part->x.size(), 20U);
  ASSERT_EQ(part->y.size(), 5U);
  for (std::size_t i = 0; i < 20; ++i) EXPECT_NEAR(part->x[i], whole->x[8 + 2 * i], 1e-12);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(part->y[i], whole->y[4 + 4 * i], 1e-12);
}

TEST(DepthImage, KWherePIsZero) {
  CameraModel camera = camera_of(64, 48);
  camera.P = {};
  std::shared_ptr<const DepthRays> rays;
  ASSERT_EQ(check_camera(camera, &rays), "");
  EXPECT_DOUBLE_EQ(rays->x[3], (3.0 - camera.K[2]) / camera.K[0]);
  EXPECT_FALSE(is_distorted(camera));
  camera.D = {0.0, 0.0, 0.0};
  EXPECT_FALSE(is_distorted(camera));
  camera.D = {0.0, -0.1, 0.0};
  EXPECT_TRUE(is_distorted(camera));
  camera.D = {kNan};
  EXPECT_TRUE(is_distorted(camera));
}

TEST(DepthImage, FaultyCameras) {
  struct Case {
    const char* says;
    void (*change)(CameraModel*);
  };
  const Case cases[] = {
      {"not calibrated", [](CameraModel* c) { c->P = {}, c->K = {}; }},
      {"P[0] is 0, a focal length", [](CameraModel* c) { c->P[0] = 0.0; }},
      {"P[5] is -1, a focal length", [](CameraModel* c) { c->P[5] = -1.0; }},
      {"P[2] is nan", [](CameraModel* c) { c->P[2] = kNan; }},
      {"P[6] is inf", [](CameraModel* c) { c->P[6] = kInf; }},
      {"P[1] is 0.5, it must be 0", [](CameraModel* c) { c->P[1] = 0.5; }},
      {"P[11] is 1, it must be 0", [](CameraModel* c) { c->P[11] = 1.0; }},
      {"centre of projection at (20, -0, 0) m", [](CameraModel* c) { c->P[3] = -20.0 * c->P[0]; }},
      {"P[7] is nan", [](CameraModel* c) { c->P[7] = kNan; }},
      {"P[10] is 0, it must be 1", [](CameraModel* c) { c->P[10] = 0.0; }},
      {"K[0] is nan", [](CameraModel* c) { c->P = {}, c->K[0] = kNan; }},
      {"width is 0", [](CameraModel* c) { c->width = 0; }},
      {"height is 4e+09", [](CameraModel* c) { c->height = 4000000000U; }},
      {"ends at pixel 70", [](CameraModel* c) { c->roi_x_offset = 60, c->roi_width = 10; }},
      {"ends at pixel 4294967304",
       [](CameraModel* c) { c->roi_y_offset = 4294967295U, c->roi_height = 9; }},
      {"is empty", [](CameraModel* c) { c->roi_x_offset = 60; }},
      {"binning of the width is 65", [](CameraModel* c) { c->binning_x = 65; }},
      {"89 degrees", [](CameraModel* c) { c->P[0] = 1e-300; }},
      {"89 degrees", [](CameraModel* c) { c->P[6] = 1e200; }},
  };
  for (const Case& one : cases) {
    CameraModel camera = camera_of(64, 48);
    one.change(&camera);
    std::shared_ptr<const DepthRays> rays;
    test::expect_says(check_camera(camera, &rays), one.says);
    EXPECT_EQ(rays, nullptr) << one.says;
  }
}

TEST(DepthImage, FaultyImages) {
  struct Case {
    const char* says;
    void (*change)(DepthImage*);
  };
  const Case cases[] = {
      {"encoding is 'rgb8'", [](DepthImage* i) { i->encoding = "rgb8"; }},
      {"encoding is ''", [](DepthImage* i) { i->encoding.clear(); }},
      {"width 0 * height 4", [](DepthImage* i) { i->width = 0; }},
      {"step is 63, less than", [](DepthImage* i) { i->step = 63; }},
      {"step is 64, less than", [](DepthImage* i) { i->encoding = "32FC1"; }},
      {"data holds 255 bytes", [](DepthImage* i) { i->data_size = 255; }},
      {"data holds 256 bytes", [](DepthImage* i) { i->height = 4294967295U; }},
      {"data is null", [](DepthImage* i) { i->data = nullptr; }},
      {"has 31 x 4 pixels, its camera", [](DepthImage* i) { i->width = 31; }},
      {"has 32 x 3 pixels, its camera", [](DepthImage* i) { i->height = 3; }},
  };
  const Message message(std::vector<double>(128, 1.0), 32, camera_of(32, 4), {});
  for (const Case& one : cases) {
    DepthImage image = message.image;
    one.change(&image);
    RawCloud cloud;
    test::expect_says(check_depth_image(image, message.rays, &cloud), one.says);
    EXPECT_EQ(cloud.data, nullptr) << one.says;
  }
  RawCloud cloud;
  test::expect_says(check_depth_image(message.image, message.rays, &cloud, 127), "max_points");
  EXPECT_NE(check_depth_image(message.image, nullptr, &cloud), "");
}

}  // namespace
}  // namespace ist
