// The sums of a blend, in which small tiles of points enter as their moments, against the sums over
// all pairs in double.

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "repulsion/blend_kernel.h"
#include "support/contact_oracle.h"
#include "support/instruction_sets.h"
#include "support/sanitizers.h"
#include "support/scene.h"
#include "support/tiles.h"

namespace ist {
namespace {

using Eigen::Vector3d;

// The sums of one sphere.
struct Sums {
  double weight = 0.0;
  Vector3d force = Vector3d::Zero();
};

struct Sphere {
  Vector3d center;  // [m] in O
  double radius;    // [m]
};

struct Scene {
  CloudSnapshot cloud;
  std::vector<ThinnedTile> tiles;
  std::vector<Sphere> spheres;
  double smoothing = 0.1;  // [m]
  double nearest = std::numeric_limits<double>::infinity();
};

// A wavy wall with a point each 5 mm, thinned to 10 mm, and sixteen spheres before it.
Scene scene_of(test::Rng* rng) {
  Scene scene;
  std::vector<Vector3d> points;
  const double wave = test::uniform(rng, 0.0, 0.05);
  for (int i = -80; i < 80; ++i) {
    for (int j = -80; j < 80; ++j) {
      const double x = 0.005 * i, y = 0.005 * j;
      points.emplace_back(x, y, wave * std::sin(20.0 * x) * std::cos(15.0 * y));
    }
  }
  scene.cloud = test::thinned(points, 0.01);
  scene.tiles = test::thinned_tiles_of(scene.cloud.index);
  const double height = test::uniform(rng, 0.05, 0.4);
  scene.smoothing = test::uniform(rng, 0.02, 0.3);
  for (int i = 0; i < kSphereGroupWidth; ++i) {
    const Vector3d side = test::random_vector(rng, 0.1);
    scene.spheres.push_back(
        {Vector3d(side.x(), side.y(), height + 0.3 * (side.z() + 0.1)), 0.02 + 0.002 * i});
  }
  for (const ThinnedTile& tile : scene.tiles) {
    for (int k = 0; k < tile.count; ++k) {
      for (const Sphere& sphere : scene.spheres) {
        scene.nearest =
            std::min(scene.nearest, (sphere.center - tile.point(k)).norm() - sphere.radius);
      }
    }
  }
  return scene;
}

// The sums over all points for one sphere that has moved by `moved`.
Sums pair_by_pair(const Scene& scene, const Sphere& sphere, const Vector3d& moved) {
  Sums sums;
  for (const ThinnedTile& tile : scene.tiles) {
    for (int k = 0; k < tile.count; ++k) {
      const Vector3d offset = sphere.center + moved - tile.point(k);
      const double d = offset.norm() - sphere.radius;
      const double root = std::max(1.0 - (d - scene.nearest) / scene.smoothing, 0.0);
      const double w = root * root * static_cast<double>(tile.weight[k]);
      sums.weight += w;
      sums.force += w * offset.normalized();
    }
  }
  return sums;
}

SphereSums sums_of(const Scene& scene) {
  std::vector<InnerSphere> spheres;
  for (const Sphere& sphere : scene.spheres) {
    spheres.push_back({sphere.center, sphere.radius, sphere.radius});
  }
  // One group, so that its slots are in the order of the spheres.
  const std::vector<SphereGroup> groups = group_spheres(spheres);
  PosedSpheres posed;
  posed.groups = groups.data();
  posed.count = groups.size();
  for (int i = 0; i < 3; ++i) posed.R_OL[4 * i] = 1.0F;
  Deadline deadline(TimePoint::max());
  SphereSums sums;
  blend_pairs(scene.cloud.index.bvh().thinned(), posed,
              {static_cast<float>(scene.nearest), static_cast<float>(scene.smoothing)}, &deadline,
              &sums);
  return sums;
}

Vector3d vector(const BySphere v[3], std::size_t i) { return Vector3d(v[0][i], v[1][i], v[2][i]); }

// Errors as shares of the weight of all spheres; the largest one here is 3.4e-4.
TEST(TileMoments, SumsAreThoseOfAllPairs) {
  test::for_each_instruction_set([] {
    test::Rng rng(301);
    double largest = 0.0;
    for (int trial = 0; trial < test::scaled(40); ++trial) {
      const Scene scene = scene_of(&rng);
      const SphereSums sums = sums_of(scene);
      double weight_error = 0.0, all = 0.0;
      Vector3d force_error = Vector3d::Zero();
      for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
        const Sums truth = pair_by_pair(scene, scene.spheres[i], Vector3d::Zero());
        weight_error += static_cast<double>(sums.weight[i]) - truth.weight;
        force_error += vector(sums.force, i) - truth.force;
        all += truth.weight;
        EXPECT_GE(sums.weight[i], 0.0F);
      }
      largest = std::max({largest, std::abs(weight_error) / all, force_error.norm() / all});
    }
    EXPECT_LT(largest, 5e-4);
  });
}

// The slopes err by less than the share that BlendExpansion allows for them, 0.2: those of the
// motion of each sphere along each axis, against differences of the sums over all pairs. Here they
// err by 0.036 at most.
TEST(TileMoments, SlopesAreThoseOfAllPairs) {
  test::Rng rng(302);
  constexpr double kStep = 1e-5;  // [m]
  double largest = 0.0;
  for (int trial = 0; trial < test::scaled(20); ++trial) {
    const Scene scene = scene_of(&rng);
    const SphereSums sums = sums_of(scene);
    double error = 0.0, all = 0.0;
    for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
      const Sphere& sphere = scene.spheres[i];
      Eigen::Matrix3d slopes;  // of the force, by the sphere's motion
      const auto outer = [&](int k) { return static_cast<double>(sums.outer[k][i]); };
      slopes << outer(0), outer(3), outer(5),  //
          outer(3), outer(1), outer(4),        //
          outer(5), outer(4), outer(2);
      slopes.diagonal().array() += static_cast<double>(sums.per_length[i]);
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3d step = kStep * Vector3d::Unit(axis);
        const Sums more = pair_by_pair(scene, sphere, step),
                   less = pair_by_pair(scene, sphere, -step);
        const Vector3d truth = (more.force - less.force) / (2.0 * kStep);
        const double of_weight = (more.weight - less.weight) / (2.0 * kStep);
        error +=
            (slopes.col(axis) - truth).norm() + std::abs(vector(sums.slope, i)[axis] - of_weight);
        all += truth.norm() + std::abs(of_weight);
      }
    }
    largest = std::max(largest, error / all);
  }
  EXPECT_LT(largest, 0.1);
}

// Spheres move in steps of 22 um, so that tiles become small for them or not, and begin and end to
// count. The mean direction changes little in each step, here by 3.4e-5 at most.
TEST(TileMoments, NothingJumps) {
  test::Rng rng(303);
  double largest = 0.0;
  for (int trial = 0; trial < test::scaled(4); ++trial) {
    Scene scene = scene_of(&rng);
    Vector3d last = Vector3d::Zero();
    for (int step = 0; step < 400; ++step) {
      for (Sphere& sphere : scene.spheres) sphere.center += Vector3d(2e-5, 0.0, 1e-5);
      const SphereSums sums = sums_of(scene);
      Vector3d force = Vector3d::Zero();
      double weight = 0.0;
      for (std::size_t i = 0; i < scene.spheres.size(); ++i) {
        force += vector(sums.force, i);
        weight += static_cast<double>(sums.weight[i]);
      }
      const Vector3d mean = force / weight;
      if (step > 0) largest = std::max(largest, (mean - last).norm());
      last = mean;
    }
  }
  EXPECT_LT(largest, 1e-4);
}

}  // namespace
}  // namespace ist
