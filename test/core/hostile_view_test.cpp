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
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// What a filter keeps of an image, and another one has lost: single pixels or pairs near the robot
// may be lost to noise.
struct Lost {
  std::set<std::uint32_t> pixels;

  Lost(const std::set<std::uint32_t>& least, const std::set<std::uint32_t>& kept) {
    std::set_difference(least.begin(), least.end(), kept.begin(), kept.end(),
                        std::inserter(pixels, pixels.end()));
  }
  // Those that are within so many pixels of one of them.
  int around(std::uint32_t pixel, std::uint32_t width, int apart) const {
    int count = 0;
    for (const std::uint32_t other : pixels) {
      const int rows = static_cast<int>(other / width) - static_cast<int>(pixel / width);
      const int columns = static_cast<int>(other % width) - static_cast<int>(pixel % width);
      count += std::abs(rows) <= apart && std::abs(columns) <= apart ? 1 : 0;
    }
    return count;
  }
};

// Whatever is in the picture: what the padding keeps, the view keeps, but for single pixels and
// pairs within the noise; all that it keeps is where it was measured, by the pose that it says; its
// correction is within what was stated.
TEST(HostileView, NothingIsLostThatThePaddingKeeps) {
  test::Rng rng(31);
  const auto uniform = [&](double low, double high) { return test::uniform(&rng, low, high); };
  const std::vector<LinkModel> bodies = {
      test::make_link(Box{{0.2, 0.3, 0.1}}, 0.01), test::make_link(Cylinder{0.05, 0.4}, 0.01),
      test::make_link(test::icosphere(0.1, 3), 0.01), test::make_link(Sphere{0.08}, 0.01)};
  int views = 0, kept_more = 0, on_robot = 0;
  std::size_t lost_pixels = 0;
  const int scenes = test::scaled(24);
  for (int scene = 0; scene < scenes; ++scene) {
    IngestConfig config;
    config.min_range = uniform(0, 1) < 0.5 ? 0.0 : 0.05;
    config.self_filter_mode = SelfFilterMode::kView;
    config.view.noise = {std::pow(10.0, uniform(-5, -1.5)), uniform(0.0, 0.01)};
    config.view.position_error = std::pow(10.0, uniform(-4, -1));
    config.view.angle_error = std::pow(10.0, uniform(-4, -1));
    config.view.mixed_pixels = uniform(0.0, 3.0);
    Ingest by_view(config);
    IngestConfig padding = config;
    padding.self_filter_mode = SelfFilterMode::kPadding;
    Ingest by_padding(padding);
    CameraModel camera;
    camera.width = static_cast<std::uint32_t>(uniform(4, 90));
    camera.height = static_cast<std::uint32_t>(uniform(4, 70));
    const double focal = uniform(20, 200);
    camera.P = {focal, 0, 0.5 * camera.width, 0, 0, focal, 0.5 * camera.height, 0, 0, 0, 1, 0};
    std::shared_ptr<const DepthRays> rays;
    ASSERT_EQ(check_camera(camera, &rays), "");
    const Eigen::Isometry3d X_FS = test::random_pose(&rng, 1.0);
    std::vector<Eigen::Isometry3d> X_SL;
    for (std::size_t b = 0; b < bodies.size(); ++b) {
      X_SL.push_back(test::random_pose(&rng, scene % 5 == 0 ? 0.1 : 0.5));  // some hold the camera
      X_SL.back().translation().z() += scene % 4 == 0 ? -0.5 : 0.8;
    }
    double stamp = 0.0;
    for (int frame = 0; frame < 3; ++frame) {
      std::vector<float> depths(camera.width * camera.height);
      for (std::size_t i = 0; i < depths.size(); ++i) {
        const double u = uniform(0, 1);
        const Eigen::Vector3d ray(rays->x[i % camera.width], rays->y[i / camera.width], 1.0);
        double z = uniform(0, 1) < 0.02 ? uniform(0.0, 2.5) : 2.0;
        for (std::size_t b = 0; b < bodies.size(); ++b) {  // steps along the ray up to a body
          const Eigen::Isometry3d X_LS = X_SL[b].inverse();
          for (double t = 0.02; t < z;) {
            const double distance = bodies[b].solid.signed_distance(X_LS * (t * ray)).distance;
            if (distance < 0.01) z = t;
            t += std::max(0.01, (distance - 0.01) / ray.norm());
          }
        }
        z += 0.003 * uniform(-1, 1);
        const bool is_on_board = i % camera.width / 12 == 1 && i / camera.width / 12 == 1;
        if (scene % 2 == 0 && is_on_board) z -= 0.015;  // in front of the robot, or of nothing
        depths[i] = static_cast<float>(z);
        if (u < 0.01) depths[i] = 0.0F;
        if (u > 0.99) depths[i] = static_cast<float>(kInfinity);
        if (u > 0.48 && u < 0.5) depths[i] = std::nanf("");
        if (u > 0.50 && u < 0.51) depths[i] = 1e-30F;
      }
      DepthImage image;
      image.encoding = "32FC1";
      image.width = camera.width;
      image.height = camera.height;
      image.step = 4 * camera.width;
      image.data = reinterpret_cast<const std::uint8_t*>(depths.data());
      image.data_size = 4 * depths.size();
      RawCloud raw;
      ASSERT_EQ(check_depth_image(image, rays, &raw), "");
      std::vector<PosedSolid> robot;
      for (std::size_t b = 0; b < bodies.size(); ++b) {
        robot.emplace_back();
        robot.back().tree = &bodies[b].tree;
        robot.back().solid = &bodies[b].solid;
        robot.back().X_FL = X_FS * X_SL[b];
      }
      CloudSnapshot viewed, padded;
      by_view.run(raw, X_FS, robot, stamp, &viewed);
      if (frame == 0) stamp -= 5.0;  // the clock goes back, then stands still
      ASSERT_TRUE(viewed.X_FS.matrix().allFinite());
      by_padding.run(raw, viewed.X_FS, robot, stamp, &padded);
      const std::set<std::uint32_t> kept = test::ids_of(viewed.index),
                                    least = test::ids_of(padded.index);
      const Lost lost(least, kept);
      for (const std::uint32_t pixel : lost.pixels) {
        ASSERT_LE(lost.around(pixel, camera.width, 4), 2)
            << "scene " << scene << ", frame " << frame << ": " << kept.size() << " and "
            << least.size();
        const Eigen::Vector3d ray(rays->x[pixel % camera.width], rays->y[pixel / camera.width], 1);
        const Eigen::Vector3d p_S = static_cast<double>(depths[pixel]) * ray;
        double nearest = kInfinity;
        for (const PosedSolid& solid : robot) {
          const Eigen::Vector3d p_L = solid.X_FL.inverse() * (viewed.X_FS * p_S);
          nearest = std::min(nearest, solid.solid->signed_distance(p_L).distance);
        }
        ASSERT_LE(nearest, config.self_filter_padding + 3.0 * config.view.noise.sigma(p_S.norm()));
      }
      lost_pixels += lost.pixels.size();
      ASSERT_EQ(viewed.counts.used, kept.size());
      kept_more += kept.size() > least.size() ? 1 : 0;
      on_robot += viewed.counts.on_robot > 0 ? 1 : 0;
      views += viewed.view.is_used ? 1 : 0;
      const Eigen::Isometry3d X_SC = X_FS.inverse() * viewed.X_FS;
      EXPECT_LE(Eigen::AngleAxisd(X_SC.linear()).angle(), 3.0 * config.view.angle_error + 1e-9)
          << "scene " << scene;
      for (const PointTile& tile : test::tiles_of(viewed.index)) {
        for (int k = 0; k < tile.count; ++k) {
          const std::size_t i = tile.id[k];
          const auto z = static_cast<double>(depths[i]);
          const Eigen::Vector3d p_S(rays->x[i % camera.width] * z, rays->y[i / camera.width] * z,
                                    z);
          ASSERT_LT((viewed.index.X_FO() * tile.point(k) - viewed.X_FS * p_S).norm(), 1e-5);
        }
      }
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
