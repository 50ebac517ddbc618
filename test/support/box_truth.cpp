#include "support/box_truth.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>

#include "internal/cloud/box_bvh.h"
#include "support/box_oracle.h"
#include "support/meshes.h"
#include "support/oracle.h"

namespace ist::test {

BoxTruth truth_of(const TriangleMesh& mesh, const CloudSnapshot& map,
                  const Eigen::Isometry3d& X_FL) {
  BoxTruth truth;
  const BoxOracle oracle(mesh);
  const Eigen::AlignedBox3d around = bounds(mesh);
  const Eigen::Isometry3d X_LM = X_FL.inverse() * map.X_FM;
  for (const BoxTile& tile : map.boxes->bvh().tiles()) {
    for (int k = 0; k < tile.count; ++k) {
      const PlacedBox placed{tile.box(k), X_LM * Eigen::Translation3d(map.boxes->origin())};
      const Eigen::Vector3d center = placed.X * placed.box.center();
      const double radii = 0.5 * (placed.box.sizes().norm() + around.sizes().norm());
      if ((center - around.center()).norm() - radii > truth.distance) continue;
      const double distance = oracle.distance(placed);
      truth.distance = std::min(truth.distance, distance);
      truth.is_contact = truth.is_contact || distance == 0.0 ||
                         (around.contains(center) && oracle_winding(mesh, center) > 0.5);
    }
  }
  return truth;
}

double sampled_depth(Rng* rng, const TriangleMesh& mesh, const CloudSnapshot& map,
                     const Eigen::Isometry3d& X_FL, int samples) {
  double deepest = std::numeric_limits<double>::infinity();
  const Eigen::Isometry3d X_LO =
      X_FL.inverse() * map.X_FM * Eigen::Translation3d(map.boxes->origin());
  for (const BoxTile& tile : map.boxes->bvh().tiles()) {
    for (int k = 0; k < tile.count; ++k) {
      const Eigen::AlignedBox3d box = tile.box(k);
      for (int i = 0; i < samples; ++i) {
        const Eigen::Vector3d t = 0.5 * (random_vector(rng, 1.0).array() + 1.0);
        const Eigen::Vector3d p = box.min() + t.cwiseProduct(box.sizes());
        deepest = std::min(deepest, oracle_signed_distance(mesh, X_LO * p));
      }
    }
  }
  return deepest;
}

bool in_a_box(const CloudSnapshot& map, const Eigen::Vector3d& p_F) {
  const Eigen::Vector3d p_O = map.X_FM.inverse() * p_F - map.boxes->origin();
  for (const BoxTile& tile : map.boxes->bvh().tiles()) {
    for (int k = 0; k < tile.count; ++k) {
      if (tile.box(k).exteriorDistance(p_O) < 1e-9) return true;
    }
  }
  return false;
}

void expect_truth(const LinkProximity& result, const BoxTruth& truth, const TriangleMesh& mesh,
                  const CloudSnapshot& map, const Eigen::Isometry3d& X_FL,
                  const QueryConfig& config) {
  if (result.state == LinkState::kClear) {
    ASSERT_GE(truth.distance, config.max_distance - 1e-9);
    ASSERT_FALSE(truth.is_contact);
    return;
  }
  ASSERT_NEAR(result.direction.norm(), 1.0, 1e-9);
  ASSERT_LT((result.p_FCl - result.p_FCo - result.distance * result.direction).norm(), 1e-9);
  ASSERT_LT((X_FL * result.p_LCl - result.p_FCl).norm(), 1e-12);
  ASSERT_TRUE(in_a_box(map, result.p_FCo));
  ASSERT_LT(oracle_distance(mesh, result.p_LCl), 1e-9);
  ASSERT_LE(result.lower_bound, result.distance);
  ASSERT_EQ(result.state == LinkState::kContact, truth.is_contact) << result.distance;
  if (result.state == LinkState::kNear) {
    ASSERT_LE(result.lower_bound, truth.distance);
    ASSERT_GE(result.distance, truth.distance - 1e-9);
    ASSERT_LE(result.distance - result.lower_bound, config.tolerance + 2e-6);
    return;
  }
  const Eigen::Vector3d p_L = X_FL.inverse() * result.p_FCo;
  ASSERT_NEAR(result.distance, oracle_signed_distance(mesh, p_L), 1e-9);
}

}  // namespace ist::test
