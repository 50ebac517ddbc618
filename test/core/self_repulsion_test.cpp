#include "ist_proximity/repulsion/self_repulsion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "support/scene.h"

namespace ist {
namespace {

// A plate between two spheres.
class SelfRepulsionTest : public testing::Test {
 protected:
  SelfRepulsionTest() {
    config_.max_distance = 2.0;
    config_.tolerance = 0.0;
  }

  RepulsiveWrench run(std::size_t link, double above, double below) {
    std::vector<Eigen::Isometry3d> X_FL(3, Eigen::Isometry3d::Identity());
    X_FL[1].translation() = Eigen::Vector3d(0.3, 0.0, 0.11 + above);
    X_FL[2].translation() = Eigen::Vector3d(-0.3, 0.0, -0.11 - below);
    SelfQuery query(model_, pairs_, config_);
    query.run(X_FL, known_, &answers_);
    return self_repulsion(link, X_FL[link], pairs_, answers_, repulsion_);
  }

  std::shared_ptr<const RobotModel> model_ =
      test::make_model({Box{{1.0, 1.0, 0.02}}, Sphere{0.1}, Sphere{0.1}}, 0.01);
  std::vector<LinkPair> pairs_ = {{0, 1}, {2, 0}};
  std::vector<bool> known_ = {true, true, true};
  QueryConfig config_;
  RepulsionConfig repulsion_;  // 0.3 m of influence, 0.1 m of smoothing
  std::vector<PairProximity> answers_;
};

// By hand: the nearest pair alone, both with their weights, and the two in balance.
TEST_F(SelfRepulsionTest, handComputed) {
  RepulsiveWrench found = run(1, 0.12, 1.0);
  EXPECT_LT((found.force - Eigen::Vector3d(0, 0, 1.0 - 0.12 / 0.3)).norm(), 1e-9);
  EXPECT_LT(found.torque.norm(), 1e-9);  // through the sphere's centre
  found = run(0, 0.12, 1.0);
  EXPECT_LT((found.force + Eigen::Vector3d(0, 0, 0.6)).norm(), 1e-9);
  // -0.6 at x = 0.3 turns about +y.
  EXPECT_LT((found.torque - Eigen::Vector3d(0, 0.18, 0)).norm(), 1e-9);

  const double w = std::pow(1.0 - 0.04 / 0.1, 2);
  found = run(0, 0.12, 0.16);
  EXPECT_LT((found.force - Eigen::Vector3d(0, 0, 0.6 * (w - 1.0) / (w + 1.0))).norm(), 1e-9);
  EXPECT_LT((found.torque - Eigen::Vector3d(0, 0.18, 0)).norm(), 1e-9);  // both turn the same way
  found = run(0, 0.12, 0.12);
  EXPECT_LT(found.force.norm(), 1e-9);
}

// 0 at the influence distance, the gain in contact, and no jump where another link becomes nearer.
TEST_F(SelfRepulsionTest, continuousFromInfluenceToContact) {
  repulsion_.gain = 2.0;
  EXPECT_EQ(run(0, 0.31, 0.5).force.norm(), 0.0);
  EXPECT_NEAR(run(1, -0.02, 0.5).force.norm(), 2.0, 1e-9);
  Eigen::Vector3d last = run(0, 0.35, 0.1).force;
  for (double above = 0.35; above > 0.0; above -= 0.001) {
    const Eigen::Vector3d force = run(0, above, 0.1).force;
    EXPECT_LT((force - last).norm(), 0.08) << above;
    last = force;
  }
}

TEST_F(SelfRepulsionTest, unknownIsNotKnown) {
  known_[2] = false;
  EXPECT_TRUE(std::isnan(run(0, 0.1, 0.1).force.x()));
  EXPECT_FALSE(std::isnan(run(1, 0.1, 0.1).force.x()));
  EXPECT_TRUE(std::isnan(
      self_repulsion(0, Eigen::Isometry3d::Identity(), pairs_, {}, repulsion_).torque.x()));
}

}  // namespace
}  // namespace ist
