// Boxes that are near a link, and inside: which of them are outside is kept while the link moves.

#include <gtest/gtest.h>

#include <cstdint>
#include <cstdio>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/box_oracle.h"
#include "support/box_truth.h"
#include "support/meshes.h"
#include "support/sanitizers.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kVoxel = 0.008;    // [m] less than the links are thick
constexpr double kMaxError = 0.01;  // [m] the spheres say nothing of boxes that are nearer

std::vector<TriangleMesh> link_meshes() {
  return {test::l_shape(0.2, 0.05), test::torus(0.1, 0.03, 12, 8), test::icosphere(0.08, 1),
          test::thin_plate(0.1, 0.004)};
}

Eigen::AlignedBox3d voxel_at(const Eigen::Vector3d& p) {
  const Eigen::Vector3d low = kVoxel * (p / kVoxel).array().floor();
  return {low, low + Eigen::Vector3d::Constant(kVoxel)};
}

// Single voxels, and a block of some dozens, which a link can hold.
std::vector<Eigen::AlignedBox3d> random_voxels(test::Rng* rng, int count, int block) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < count; ++i) boxes.push_back(voxel_at(test::random_vector(rng, 0.15)));
  const Eigen::Vector3d corner = test::random_vector(rng, 0.05);
  for (int i = 0; i < block * block * block; ++i) {
    boxes.push_back(voxel_at(
        corner + kVoxel * Eigen::Vector3d(i % block, i / block % block, i / block / block)));
  }
  return boxes;
}

// The links go on by up to 4 mm at a time, and are elsewhere now and then.
void move(test::Rng* rng, int step, const Eigen::Vector3d& way, Eigen::Isometry3d* X) {
  if (step % 20 == 0) *X = test::random_pose(rng, 0.12);
  X->translation() += test::uniform(rng, 0.0, 0.004) * way;
  X->rotate(Eigen::AngleAxisd(test::uniform(rng, 0.0, 0.02), way.normalized()));
}

TEST(BoxesInside, AgainstOracleOnTheWay) {
  test::Rng rng(51);
  const std::vector<TriangleMesh> meshes = link_meshes();
  const auto model = test::make_model({meshes.begin(), meshes.end()}, kMaxError);
  QueryConfig config;
  const std::vector<bool> known(meshes.size(), true);
  std::vector<LinkProximity> results;
  std::vector<Eigen::Isometry3d> X_FL(meshes.size());
  int near = 0, contact = 0;
  for (int scene = 0; scene < test::scaled(12); ++scene) {
    config.tolerance = scene % 2 == 0 ? 0.001 : 0.0;
    ProximityQuery query(model, config);
    const CloudSnapshot map =
        test::make_map(random_voxels(&rng, 3 + scene, scene % 5), test::random_pose(&rng, 0.01));
    const Eigen::Vector3d way = test::random_vector(&rng, 1.0).normalized();
    for (int step = 0; step < 60; ++step) {
      for (Eigen::Isometry3d& X : X_FL) move(&rng, step, way, &X);
      query.run(X_FL, known, {&map}, &results);
      for (std::size_t i = 0; i < meshes.size(); ++i) {
        SCOPED_TRACE("scene " + std::to_string(scene) + " step " + std::to_string(step) + " link " +
                     std::to_string(i));
        const test::BoxTruth truth = test::truth_of(meshes[i], map, X_FL[i]);
        ASSERT_NO_FATAL_FAILURE(
            test::expect_truth(results[i], truth, meshes[i], map, X_FL[i], config));
        near += results[i].state == LinkState::kNear;
        if (results[i].state != LinkState::kContact) continue;
        if (++contact % 50 != 0) continue;
        ASSERT_LE(results[i].lower_bound, test::sampled_depth(&rng, meshes[i], map, X_FL[i], 50));
      }
    }
  }
  EXPECT_GT(near, test::scaled(1000));
  EXPECT_GT(contact, test::scaled(500));
  std::printf("%d near, %d in contact\n", near, contact);
}

// Of a link with holes, the centre of a box decides that touches no triangle, whatever was inside
// at the last pose.
TEST(BoxesInside, LinkWithHolesAgreesWithAFreshQuery) {
  test::Rng rng(52);
  const auto model = test::make_model({Shape(test::open_box({0.1, 0.1, 0.1}))}, kMaxError);
  const QueryConfig config;
  std::vector<LinkProximity> result, anew;
  int contact = 0;
  for (int scene = 0; scene < test::scaled(100); ++scene) {
    ProximityQuery query(model, config);
    const CloudSnapshot map = test::make_map(random_voxels(&rng, 3 + scene % 20, scene % 5));
    const Eigen::Vector3d way = test::random_vector(&rng, 1.0).normalized();
    Eigen::Isometry3d X;
    for (int step = 0; step < 60; ++step) {
      move(&rng, step, way, &X);
      query.run({&X, 1}, {true}, {&map}, &result);
      ProximityQuery fresh(model, config);
      fresh.run({&X, 1}, {true}, {&map}, &anew);
      ASSERT_LE(result[0].lower_bound, anew[0].distance + 1e-9) << scene << " " << step;
      ASSERT_GE(result[0].distance, anew[0].lower_bound - 1e-9) << scene << " " << step;
      contact += result[0].state == LinkState::kContact ? 1 : 0;
    }
  }
  EXPECT_GT(contact, test::scaled(500));
}

// A link goes along thousands of voxels that are nearer than its spheres tell: each is told to be
// outside once, not at every step.
TEST(BoxesInside, AreToldOnceForManySteps) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < 50 * 50; ++i) {
    boxes.push_back(voxel_at(kVoxel * Eigen::Vector3d(i % 50 - 24.5, i / 50 - 24.5, 0.5)));
  }
  const CloudSnapshot map = test::make_map(boxes);
  const auto model = test::make_model({Shape(test::torus(0.05, 0.03, 48, 24))}, kMaxError);
  const QueryConfig config;
  ProximityQuery query(model, config);
  std::vector<LinkProximity> results;
  std::uint64_t kept = 0, afresh = 0;
  for (int step = 0; step < 100; ++step) {
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    X.translation() = Eigen::Vector3d(1e-4 * step, 0.0, kVoxel + 0.033);
    query.run({&X, 1}, {true}, {&map}, &results);
    ASSERT_EQ(results[0].state, LinkState::kNear);
    ASSERT_NEAR(results[0].distance, 0.003, 0.0011);
    ProximityQuery fresh(model, config);
    fresh.run({&X, 1}, {true}, {&map}, &results);
    kept += query.statistics().exact_evaluations;
    afresh += fresh.statistics().exact_evaluations;
  }
  std::printf("%.1f exact distances a step, %.1f afresh\n", 0.01 * static_cast<double>(kept),
              0.01 * static_cast<double>(afresh));
  // Sanitizers have the link packed coarser, which leaves more to be measured at each step.
  EXPECT_LT((test::kSanitized ? 3 : 4) * kept, afresh);
}

}  // namespace
}  // namespace ist
