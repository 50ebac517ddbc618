#include "ist_proximity/contact/contact_volume.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/scene.h"

namespace ist {
namespace {

LinkProximity answer(LinkState state, double distance, double lower_bound) {
  LinkProximity proximity;
  proximity.state = state;
  proximity.distance = distance;
  proximity.lower_bound = lower_bound;
  return proximity;
}

bool is_unknown(const Wrench& wrench) {
  return wrench.force.array().isNaN().all() && wrench.torque.array().isNaN().all();
}

bool is_zero(const Wrench& wrench) { return wrench.force.isZero(0.0) && wrench.torque.isZero(0.0); }

TEST(Penetration, IsTheVolumeTimesTheStiffnessInTheFixedFrame) {
  test::Rng rng(31);
  ContactVolume volume;
  volume.volume = 2e-3;
  volume.weighted_normal = Eigen::Vector3d(1e-3, -2e-4, 5e-4);
  volume.weighted_moment = Eigen::Vector3d(-1e-5, 3e-5, 2e-5);
  const Eigen::Isometry3d X_FL = test::random_pose(&rng, 1.0);
  const PenetrationConfig config{5e4};
  const Wrench wrench =
      penetration_wrench(answer(LinkState::kContact, -0.01, -0.011), {}, &volume, X_FL, config);
  EXPECT_LT((wrench.force - 5e4 * (X_FL.linear() * volume.weighted_normal)).norm(), 1e-9);
  // The torque is about the link's origin at any pose.
  EXPECT_LT((wrench.torque - 5e4 * (X_FL.linear() * volume.weighted_moment)).norm(), 1e-9);
}

TEST(Penetration, IsZeroApartAndNaNWhenItIsNotKnown) {
  const ContactVolume volume{1e-3, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 1};
  const auto wrench = [](const LinkProximity& proximity, const ContactVolume* contact) {
    QueryConfig query;
    query.margin = 0.02;
    return penetration_wrench(proximity, query, contact, Eigen::Isometry3d::Identity(), {});
  };
  EXPECT_TRUE(is_unknown(wrench(LinkProximity(), &volume)));
  EXPECT_TRUE(is_zero(wrench(answer(LinkState::kClear, INFINITY, 1.0), nullptr)));
  EXPECT_TRUE(is_zero(wrench(answer(LinkState::kNear, 0.01, 0.009), nullptr)));
  // The margin was subtracted from a bound that holds without it.
  EXPECT_TRUE(is_zero(wrench(answer(LinkState::kNear, 0.001, -0.0199), nullptr)));
  // A deadline passed before it was known whether points are inside.
  EXPECT_TRUE(is_unknown(wrench(answer(LinkState::kNear, 0.01, -0.15), nullptr)));
  // The disjoint packing is not built yet.
  EXPECT_TRUE(is_unknown(wrench(answer(LinkState::kContact, -0.01, -0.011), nullptr)));
}

TEST(Penetration, ReactionIsTheSameForceAboutTheOtherOrigin) {
  test::Rng rng(32);
  for (int i = 0; i < 20; ++i) {
    const Eigen::Vector3d p_FA = test::random_vector(&rng, 1.0),
                          p_FB = test::random_vector(&rng, 1), p_F = test::random_vector(&rng, 1.0),
                          f = test::random_vector(&rng, 1.0);
    const Wrench on_first{f, (p_F - p_FA).cross(f)};
    const Wrench on_second = reaction(on_first, p_FA - p_FB);
    EXPECT_LT((on_second.force + f).norm(), 1e-12);
    EXPECT_LT((on_second.torque + (p_F - p_FB).cross(f)).norm(), 1e-12);
  }
}

}  // namespace
}  // namespace ist
