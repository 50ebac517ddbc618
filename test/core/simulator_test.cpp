#include "simulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "scene.h"
#include "support/demo_arm.h"
#include "support/meshes.h"
#include "support/random_links.h"
#include "support/scene.h"
#include "support/shape_oracle.h"

namespace ist::sim {
namespace {

// A ray meets the surface at the stated distance, and no other surface before.
void check_hit(const Shape& shape, const Solid& solid, test::Rng* rng) {
  const RayShape caster(shape);
  int hits = 0;
  for (int i = 0; i < 300; ++i) {
    const Eigen::Vector3d origin = test::random_vector(rng, 0.6);
    const Eigen::Vector3d toward =
        caster.center() + test::random_vector(rng, 1.2 * caster.radius());
    const Ray ray{origin, toward - origin};
    const double t = caster.hit(ray);
    hits += std::isfinite(t) ? 1 : 0;
    if (std::isfinite(t)) {
      EXPECT_GT(t, 0.0);
      EXPECT_NEAR(solid.signed_distance(origin + t * ray.direction).distance, 0.0, 1e-9);
    }
    const bool inside = solid.is_inside(origin);
    for (int k = 1; k < 40; ++k) {
      const double s = 0.05 * k;
      if (s >= t) break;
      const double d = solid.signed_distance(origin + s * ray.direction).distance;
      if (std::abs(d) > 1e-9) EXPECT_EQ(d < 0.0, inside) << "passed a surface at " << s;
    }
  }
  EXPECT_GT(hits, 30);
  EXPECT_LT(hits, 300);
}

TEST(RayShape, MeetsTheSurfaceAndNothingBefore) {
  test::Rng rng(1);
  for (const Shape& shape : std::vector<Shape>{Box{{0.3, 0.2, 0.5}}, Cylinder{0.15, 0.4},
                                               Sphere{0.25}, Shape(test::icosphere(0.3, 2))}) {
    check_hit(shape, Solid(test::one(shape)), &rng);
  }
}

// Every point lies on the robot or an obstacle as they were at the stamp, if there is no noise.
TEST(Simulation, PointsLieOnTheRobotOrAnObstacle) {
  const RobotDescription robot = test::demo_robot();
  std::vector<DepthCameraConfig> cameras = demo_cameras();
  for (DepthCameraConfig& camera : cameras) camera.noise = 0.0;
  Simulation world(robot, demo_arm(), demo_obstacles(), cameras, 1);
  Eigen::VectorXd command(6);
  command << 0.5, 0.2, 0.4, 1.0, -1.0, 0.3;
  std::vector<Picture> pictures;
  while (pictures.size() < 4) {
    world.step(command);
    for (Picture& picture : world.take_pictures()) {
      EXPECT_NEAR(world.time() - picture.stamp, cameras[picture.camera].latency, 1e-9);
      pictures.push_back(std::move(picture));
    }
  }
  std::vector<Solid> links;
  for (const LinkDescription& link : robot.links) links.emplace_back(link.geometry);
  for (const Picture& picture : pictures) {
    const std::vector<Eigen::Isometry3d> X_FL = world.link_poses(picture.stamp);
    std::size_t on_robot = 0, on_others = 0;
    for (const Eigen::Vector3f& p_C : picture.points) {
      if (!p_C.allFinite()) continue;
      const Eigen::Vector3d p_F = cameras[picture.camera].X_FC * p_C.cast<double>();
      double to_robot = 1.0, to_others = 1.0;
      for (std::size_t i = 0; i < links.size(); ++i) {
        const double d = links[i].signed_distance(X_FL[i].inverse() * p_F).distance;
        to_robot = std::min(to_robot, d);
      }
      for (const Obstacle& obstacle : world.obstacles()) {
        const Eigen::Vector3d p_O = obstacle.pose(picture.stamp).inverse() * p_F;
        to_others =
            std::min(to_others, test::oracle_signed_distance(test::one(obstacle.shape), p_O));
      }
      EXPECT_NEAR(std::min(to_robot, to_others), 0.0, 1e-5);
      (to_robot < to_others ? on_robot : on_others) += 1;
    }
    EXPECT_GT(on_robot, 300U);
    EXPECT_GT(on_others, 1000U);
  }
}

// The smallest distance of all links and obstacles, by brute force.
TEST(Simulation, TruthIsTheSmallestDistance) {
  const RobotDescription robot = test::demo_robot();
  Simulation world(robot, demo_arm(), demo_obstacles(), {}, 1);
  std::vector<Solid> links;
  for (const LinkDescription& link : robot.links) links.emplace_back(link.geometry);
  for (int i = 0; i < 2000; ++i) {
    world.step(Eigen::VectorXd::Constant(6, 0.2));
    if (i % 200 != 0) continue;
    const std::vector<Eigen::Isometry3d> X_FL = world.link_poses();
    double smallest = 10.0;
    for (std::size_t l = 0; l < links.size(); ++l) {
      if (!world.arm().moved()[l]) continue;
      for (const Obstacle& obstacle : world.obstacles()) {
        const Eigen::Isometry3d X_FO = obstacle.pose(world.time());
        smallest = std::min(smallest, distance(links[l], X_FL[l], obstacle, X_FO, 10.0));
      }
    }
    EXPECT_DOUBLE_EQ(world.nearest(10.0).distance, smallest);
    EXPECT_TRUE(std::isinf(world.nearest(0.5 * smallest).distance));
  }
}

}  // namespace
}  // namespace ist::sim
