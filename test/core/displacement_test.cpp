// How far a point, or any point of a link, moves between two poses, what is left of a bound, and
// when nothing is.

#include "proximity/coherence/displacement.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "proximity/coherence/front_pose.h"
#include "proximity/coherence/link_bound.h"
#include "proximity/coherence/search_front.h"
#include "support/meshes.h"
#include "support/random_numbers.h"
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

Eigen::AlignedBox3d random_box(test::Rng* rng) {
  Eigen::AlignedBox3d box(test::random_vector(rng, 1.0));
  return box.extend(test::random_vector(rng, 1.0));
}

// [m] In extended precision.
double farthest_corner(const Eigen::AlignedBox3d& box, const Eigen::Isometry3d& X_FA,
                       const Eigen::Isometry3d& X_FB) {
  using Vector = Eigen::Matrix<long double, 3, 1>;
  long double farthest = 0.0L;
  for (int k = 0; k < 8; ++k) {
    const Vector corner =
        box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(k)).cast<long double>();
    const Vector a = X_FA.linear().cast<long double>() * corner +
                     X_FA.translation().cast<long double>(),
                 b = X_FB.linear().cast<long double>() * corner +
                     X_FB.translation().cast<long double>();
    farthest = std::max(farthest, (b - a).norm());
  }
  return static_cast<double>(farthest);
}

// Small steps and large ones, near the origin and far from it.
TEST(Displacement, IsThatOfTheFarthestCorner) {
  test::Rng rng(1);
  for (int i = 0; i < 20000; ++i) {
    const Eigen::AlignedBox3d box = random_box(&rng);
    const Eigen::Isometry3d X_FA = test::random_pose(&rng, i % 2 == 0 ? 1.0 : 1000.0);
    const double step = std::pow(10.0, test::uniform(&rng, -9, 0));
    Eigen::Isometry3d X_FB = X_FA;
    X_FB.translation() += test::random_vector(&rng, step);
    if (i % 3 != 0) {
      X_FB.rotate(Eigen::AngleAxisd(step, test::random_vector(&rng, 1.0).normalized()));
    }
    const double truth = farthest_corner(box, X_FA, X_FB);
    const double bound = DisplacementBound(box).between(X_FA, X_FB);
    ASSERT_GE(bound, truth) << i;
    ASSERT_LE(bound, truth * (1.0 + 1e-9) + 1e-14 * (10.0 + X_FA.translation().norm())) << i;
  }
}

TEST(Displacement, IsNotKnownOfPosesThatAreNotFinite) {
  const DisplacementBound bound{Eigen::AlignedBox3d(Eigen::Vector3d::Zero())};
  const Eigen::Isometry3d X_FA = Eigen::Isometry3d::Identity();
  for (const double wrong :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Eigen::Isometry3d X_FB = X_FA;
    X_FB.translation().y() = wrong;
    EXPECT_TRUE(std::isnan(bound.between(X_FA, X_FB)));
    EXPECT_EQ(after_displacement(1.0, bound.between(X_FA, X_FB)),
              -std::numeric_limits<double>::infinity());
  }
}

// A bound b of a search with an error of r proves b - r. What a later search reads, less its own
// error, is no more than that less the displacement.
TEST(Displacement, TheRoundingOfBothSearchesIsTakenOffAStoredBound) {
  test::Rng rng(2);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::AlignedBox3d box = random_box(&rng);
    const DisplacementBound displacement(box);
    const float stores = static_cast<float>(std::pow(10.0, test::uniform(&rng, -7, -4)));
    const float reads = static_cast<float>(std::pow(10.0, test::uniform(&rng, -7, -4)));
    const Eigen::Isometry3d X_FA = test::random_pose(&rng, 1.0);
    Eigen::Isometry3d X_FB = X_FA;
    X_FB.translation() += test::random_vector(&rng, 0.01);
    FrontPose pose;
    pose.move(7, X_FA, displacement, stores, 0);
    const double bound = 0.3, stored = bound + pose.offset();
    pose.end(10);
    ASSERT_TRUE(pose.move(7, X_FB, displacement, reads, 10));
    const double read = stored - pose.offset();
    EXPECT_LE(read - static_cast<double>(reads),
              bound - static_cast<double>(stores) - farthest_corner(box, X_FA, X_FB) + 1e-12);
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

// A front without some part would leave obstacles out.
TEST(SearchFront, IsNotKeptWhenThereWasNoPlaceForAPart) {
  const DisplacementBound displacement{Eigen::AlignedBox3d(Eigen::Vector3d::Zero())};
  const Eigen::Isometry3d X_OL = Eigen::Isometry3d::Identity();
  SearchFront front;
  front.begin(7, X_OL, displacement, 0.0F);
  std::uint32_t last = 0, added = 0;
  while ((last = front.add({})) == added) ++added;  // at the end their largest number
  front.end(true);
  EXPECT_TRUE(front.empty());
  front.begin(7, X_OL, displacement, 0.0F);
  for (std::uint32_t i = 0; i < last; ++i) ASSERT_EQ(front.add({}), i);
  front.end(true);
  EXPECT_FALSE(front.empty());
}

}  // namespace
}  // namespace ist
