// How far a point, or any point of a link, moves between two poses, and what is left of a bound.

#include "proximity/coherence/displacement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "proximity/coherence/link_bound.h"
#include "support/meshes.h"
#include "support/scene.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

const std::vector<TriangleMesh>& meshes() {
  static const std::vector<TriangleMesh> kMeshes = {
      test::box({0.2, 0.1, 0.3}), test::icosphere(0.1, 2), test::l_shape(0.2, 0.05),
      test::torus(0.1, 0.03, 12, 6), test::open_box({0.15, 0.1, 0.2})};
  return kMeshes;
}

TEST(Displacement, NoPointOfALinkMovesFarther) {
  test::Rng rng(32);
  for (const TriangleMesh& mesh : meshes()) {
    const LinkModel link = test::make_link(mesh, 0.01);
    const DisplacementBound bound(link);
    for (int trial = 0; trial < 300; ++trial) {
      const double angle = std::pow(10.0, -6.0 + 0.02 * trial);
      const Eigen::Isometry3d X_FA = test::random_pose(&rng, 1.0);
      Eigen::Isometry3d X_FB = X_FA;
      X_FB.rotate(Eigen::AngleAxisd(angle, test::random_vector(&rng, 1.0).normalized()));
      X_FB.translation() += test::random_vector(&rng, trial % 3 == 0 ? 0.0 : 0.1 * angle);
      const double moved = bound.between(X_FA, X_FB);
      double farthest = 0.0;
      for (const Eigen::Vector3d& p_L : mesh.vertices)
        farthest = std::max(farthest, (X_FA * p_L - X_FB * p_L).norm());
      ASSERT_GE(moved, farthest) << trial;
      ASSERT_LE(after_displacement(1.0, moved), 1.0 - farthest) << trial;
    }
  }
}

// Near the holes of a mesh a place may become one inside although no surface has crossed it, so
// that what is proven in contact, or nearer to a hole than the link has moved, proves nothing.
TEST(LinkBound, IsKeptNearHolesOnlyWhileEveryPlaceIsOutside) {
  const auto solid = test::make_link(test::box({0.2, 0.2, 0.2}), 0.01);
  const auto open = test::make_link(test::open_box({0.2, 0.2, 0.2}), 0.01);
  ASSERT_TRUE(solid.solid.is_closed());
  ASSERT_FALSE(open.solid.is_closed());
  constexpr SceneId kScene = 7;
  Eigen::Isometry3d X_FL = Eigen::Isometry3d::Identity(), X_near = X_FL;
  X_near.translation().x() = 0.001;
  LinkBound of_solid(solid), of_open(open);
  for (const double bound : {-0.05, -0.001, 0.0, 0.05}) {
    for (const double outside : {-0.05, 0.0005, 0.05}) {
      of_solid.prove(kScene, X_FL, bound, outside, 1.0);
      of_open.prove(kScene, X_FL, bound, outside, 1.0);
      EXPECT_NEAR(of_solid.at(kScene, X_near), bound - 0.001, 1e-12);
      EXPECT_LE(of_solid.at(kScene, X_near), bound - 0.001);
      if (bound > 0.0 && outside > 0.001) {
        EXPECT_LE(of_open.at(kScene, X_near), bound - 0.001);
      } else {
        EXPECT_EQ(of_open.at(kScene, X_near), -kInfinity) << bound << ", " << outside;
      }
    }
  }
}

}  // namespace
}  // namespace ist
