// The self-filter by view under attack: robots anywhere about the camera and behind it, the camera
// inside a link, images of any size with holes, zeros and infinities, and stamps that repeat.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <iterator>
#include <limits>
#include <set>
#include <vector>

#include "ist_proximity/cloud/depth_image.h"
#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/robot_model.h"
#include "support/images.h"
#include "support/meshes.h"
#include "support/random_numbers.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// How many of some pixels are within so many rows and columns of one.
int around(std::uint32_t pixel, const std::set<std::uint32_t>& pixels, std::size_t width,
           int apart) {
  const auto row = [&](std::uint32_t i) { return static_cast<int>(i / width); };
  const auto column = [&](std::uint32_t i) { return static_cast<int>(i % width); };
  int count = 0;
  for (const std::uint32_t other : pixels) {
    const bool is_near = std::abs(row(other) - row(pixel)) <= apart &&
                         std::abs(column(other) - column(pixel)) <= apart;
    count += is_near ? 1 : 0;
  }
  return count;
}

IngestConfig random_config(test::Rng* rng) {
  IngestConfig config;
  config.min_range = test::chance(rng, 0.5) ? 0.0 : 0.05;
  config.self_filter_mode = SelfFilterMode::kView;
  config.view.noise = {test::power_of_ten(rng, -5, -1.5), test::uniform(rng, 0.0, 0.01)};
  config.view.position_error = test::power_of_ten(rng, -4, -1);
  config.view.angle_error = test::power_of_ten(rng, -4, -1);
  config.view.mixed_pixels = test::uniform(rng, 0.0, 3.0);
  return config;
}

CameraModel random_camera(test::Rng* rng) {
  CameraModel camera;
  camera.width = static_cast<std::uint32_t>(test::uniform(rng, 4, 90));
  camera.height = static_cast<std::uint32_t>(test::uniform(rng, 4, 70));
  const double focal = test::uniform(rng, 20, 200);
  camera.P = {focal, 0, 0.5 * camera.width, 0, 0, focal, 0.5 * camera.height, 0, 0, 0, 1, 0};
  return camera;
}

// A camera and a robot about it, behind it, or around it.
struct Scene {
  std::shared_ptr<const DepthRays> rays;
  Eigen::Isometry3d X_FS;
  std::vector<Eigen::Isometry3d> X_SL;
  std::vector<PosedSolid> robot;
  bool has_board;

  Scene(test::Rng* rng, const std::vector<LinkModel>& bodies, int number)
      : rays(test::rays_of(random_camera(rng))),
        X_FS(test::random_pose(rng, 1.0)),
        has_board(number % 2 == 0) {
    for (const LinkModel& body : bodies) {
      X_SL.push_back(test::random_pose(rng, number % 5 == 0 ? 0.1 : 0.5));  // some hold the camera
      X_SL.back().translation().z() += number % 4 == 0 ? -0.5 : 0.8;
      robot.push_back({&body.tree, &body.solid, X_FS * X_SL.back()});
    }
  }

  std::size_t width() const { return rays->x.size(); }
  std::size_t height() const { return rays->y.size(); }
  Eigen::Vector3d ray(std::size_t pixel) const {
    return {rays->x[pixel % width()], rays->y[pixel / width()], 1.0};
  }
  // [m] Steps along the ray of a pixel up to a body, or to a depth.
  double depth_of_bodies(std::size_t pixel, double z) const {
    for (std::size_t b = 0; b < robot.size(); ++b) {
      const Eigen::Isometry3d X_LS = X_SL[b].inverse();
      for (double t = 0.02; t < z;) {
        const double distance = robot[b].solid->signed_distance(X_LS * (t * ray(pixel))).distance;
        if (distance < 0.01) z = t;
        t += std::max(0.01, (distance - 0.01) / ray(pixel).norm());
      }
    }
    return z;
  }
  float random_depth(test::Rng* rng, std::size_t pixel) const {
    const double u = test::uniform(rng, 0, 1);
    double z = test::chance(rng, 0.02) ? test::uniform(rng, 0.0, 2.5) : 2.0;
    z = depth_of_bodies(pixel, z) + 0.003 * test::uniform(rng, -1, 1);
    const bool is_on_board = pixel % width() / 12 == 1 && pixel / width() / 12 == 1;
    if (has_board && is_on_board) z -= 0.015;  // in front of the robot, or of nothing
    if (u < 0.01) return 0.0F;
    if (u > 0.99) return static_cast<float>(kInfinity);
    if (u > 0.48 && u < 0.5) return std::nanf("");
    if (u > 0.50 && u < 0.51) return 1e-30F;
    return static_cast<float>(z);
  }
  std::vector<float> random_depths(test::Rng* rng) const {
    std::vector<float> depths(width() * height());
    for (std::size_t i = 0; i < depths.size(); ++i) depths[i] = random_depth(rng, i);
    return depths;
  }
  // [m] From the nearest body.
  double distance(const Eigen::Vector3d& p_F) const {
    double nearest = kInfinity;
    for (const PosedSolid& body : robot) {
      const Eigen::Vector3d p_L = body.X_FL.inverse() * p_F;
      nearest = std::min(nearest, body.solid->signed_distance(p_L).distance);
    }
    return nearest;
  }
};

// Single pixels or pairs near the robot may be lost to noise.
void expect_lost_to_noise(const Scene& scene, const std::vector<float>& depths,
                          const CloudSnapshot& viewed, const IngestConfig& config,
                          const std::set<std::uint32_t>& lost) {
  for (const std::uint32_t pixel : lost) {
    ASSERT_LE(around(pixel, lost, scene.width(), 4), 2);
    const Eigen::Vector3d p_S = static_cast<double>(depths[pixel]) * scene.ray(pixel);
    ASSERT_LE(scene.distance(viewed.X_FS * p_S),
              config.self_filter_padding + 3.0 * config.view.noise.sigma(p_S.norm()));
  }
}

// The pose is within the stated error, and the points are where that pose says.
void expect_where_measured(const Scene& scene, const std::vector<float>& depths,
                           const CloudSnapshot& viewed, double angle_error) {
  const Eigen::Isometry3d X_SC = scene.X_FS.inverse() * viewed.X_FS;
  EXPECT_LE(Eigen::AngleAxisd(X_SC.linear()).angle(), 3.0 * angle_error + 1e-9);
  for (const auto& [pixel, p_F] : test::points_by_id(viewed.index)) {
    const Eigen::Vector3d p_S = static_cast<double>(depths[pixel]) * scene.ray(pixel);
    ASSERT_LT((p_F - viewed.X_FS * p_S).norm(), 1e-5);
  }
}

// Whatever is in the picture: what the padding keeps, the view keeps, but for single pixels and
// pairs within the noise; all that it keeps is where it was measured, by the pose that it says; its
// correction is within what was stated.
TEST(HostileView, NothingIsLostThatThePaddingKeeps) {
  test::Rng rng(31);
  const std::vector<LinkModel> bodies = {
      test::make_link(Box{{0.2, 0.3, 0.1}}, 0.01), test::make_link(Cylinder{0.05, 0.4}, 0.01),
      test::make_link(test::icosphere(0.1, 3), 0.01), test::make_link(Sphere{0.08}, 0.01)};
  int views = 0, kept_more = 0, on_robot = 0;
  std::size_t lost_pixels = 0;
  const int scenes = test::scaled(24);
  for (int number = 0; number < scenes; ++number) {
    const IngestConfig config = random_config(&rng);
    Ingest by_view(config);
    IngestConfig padding = config;
    padding.self_filter_mode = SelfFilterMode::kPadding;
    Ingest by_padding(padding);
    const Scene scene(&rng, bodies, number);
    for (int i = 0; i < 3; ++i) {
      SCOPED_TRACE(testing::Message() << "scene " << number << ", frame " << i);
      const std::vector<float> depths = scene.random_depths(&rng);
      const RawCloud raw = test::depth_cloud(scene.rays, depths);
      CloudSnapshot viewed, padded;
      const double stamp = i == 0 ? 0.0 : -5.0;  // the clock goes back, then stands still
      by_view.run(raw, scene.X_FS, scene.robot, stamp, &viewed);
      ASSERT_TRUE(viewed.X_FS.matrix().allFinite());
      by_padding.run(raw, viewed.X_FS, scene.robot, -5.0, &padded);
      const std::set<std::uint32_t> kept = test::ids_of(viewed.index);
      const std::set<std::uint32_t> least = test::ids_of(padded.index);
      ASSERT_EQ(viewed.counts.used, kept.size());
      std::set<std::uint32_t> lost;  // that the padding keeps
      std::set_difference(least.begin(), least.end(), kept.begin(), kept.end(),
                          std::inserter(lost, lost.end()));
      expect_lost_to_noise(scene, depths, viewed, config, lost);
      expect_where_measured(scene, depths, viewed, config.view.angle_error);
      if (HasFatalFailure()) return;
      lost_pixels += lost.size();
      kept_more += kept.size() > least.size() ? 1 : 0;
      on_robot += viewed.counts.on_robot > 0 ? 1 : 0;
      views += viewed.view.is_used ? 1 : 0;
    }
  }
  EXPECT_EQ(views, 3 * scenes);
  if (test::kSanitized) return;  // too few cases to count
  EXPECT_GT(on_robot, scenes);
  EXPECT_GT(kept_more, 0);
  EXPECT_GT(lost_pixels, 0U);
}

}  // namespace
}  // namespace ist
