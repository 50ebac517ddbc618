#include "support/trial.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "support/shape_oracle.h"

namespace ist::test {

Truth truth_of(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
               const std::vector<Eigen::Vector3d>& points_F, const CloudSnapshot& cloud) {
  return {oracle_minimum(link, X_FL, points_F),
          oracle_minimum(link, X_FL, stored_points(cloud.index))};
}

void expect_witness(const LinkProximity& result, const Eigen::Isometry3d& X_FL, double scale) {
  ASSERT_GE(result.state, LinkState::kNear);
  ASSERT_TRUE(result.p_FCl.allFinite() && result.p_LCl.allFinite() && result.p_FCo.allFinite());
  EXPECT_NEAR(result.direction.norm(), 1.0, 1e-9);
  EXPECT_LT((result.p_FCl - result.p_FCo - result.distance * result.direction).norm(),
            1e-9 * scale);
  EXPECT_LT((X_FL * result.p_LCl - result.p_FCl).norm(), 1e-12 * scale);
  EXPECT_EQ(result.state == LinkState::kContact, result.distance < 0.0);
}

void expect_truth(const LinkProximity& result, const Truth& truth, const QueryConfig& config,
                  const Eigen::Isometry3d& X_FL, double rounding, double size) {
  ASSERT_NE(result.state, LinkState::kUnknown);
  // Never above the truth, but for a point whose side of a mesh float decides.
  const bool is_decided = std::min(std::abs(truth.measured), std::abs(truth.stored)) > rounding &&
                          std::signbit(truth.measured) == std::signbit(truth.stored);
  EXPECT_LE(result.lower_bound, truth.measured + (is_decided ? 0.0 : rounding));
  EXPECT_LE(result.lower_bound, result.distance);
  if (result.state == LinkState::kClear) {
    EXPECT_TRUE(std::isinf(result.distance) && result.distance > 0.0);
    EXPECT_EQ(result.lower_bound, config.max_distance);
    EXPECT_GT(truth.stored, config.max_distance);
    return;
  }
  expect_witness(result, X_FL, size + X_FL.translation().norm());
  EXPECT_GE(result.distance, truth.stored - rounding);
  EXPECT_LE(result.distance, truth.stored + config.tolerance + rounding);
  // The state does not depend on the tolerance. At touch, either state is right.
  if (std::abs(truth.stored) > rounding) {
    EXPECT_EQ(result.state == LinkState::kContact, truth.stored < 0.0);
  }
  // The interval's width includes the rounding of float coordinates.
  const double extent = X_FL.translation().norm() + std::abs(truth.stored) + 10.0 * size;
  EXPECT_LE(result.distance - result.lower_bound, config.tolerance + 2e-7 * extent);
}

Trial::Trial(const std::vector<Shape>& shapes, double max_error, double rounding)
    : model_(make_model(shapes, max_error)), rounding_(rounding) {
  for (const Shape& shape : shapes) {
    links_.push_back({GeometryElement{shape, Eigen::Isometry3d::Identity(), "test"}});
  }
}

Trial::Trial(std::shared_ptr<const RobotModel> model, std::vector<LinkGeometry> links,
             double rounding)
    : model_(std::move(model)), links_(std::move(links)), rounding_(rounding) {}

void Trial::expect(const std::vector<Eigen::Vector3d>& points_F, const Eigen::Isometry3d& X_FL,
                   const Eigen::Vector3d& origin) const {
  const CloudSnapshot cloud = make_snapshot(points_F, origin);
  const std::vector<Eigen::Isometry3d> poses(links_.size(), X_FL);
  const std::vector<bool> known(links_.size(), true);
  std::vector<LinkProximity> results;
  for (const double tolerance : {0.0, 0.001}) {
    SCOPED_TRACE("tolerance " + std::to_string(tolerance));
    QueryConfig config;
    config.max_distance = max_distance;
    config.tolerance = tolerance;
    ASSERT_TRUE(ProximityQuery(model_, config).run(poses, known, {&cloud}, &results));
    for (std::size_t i = 0; i < links_.size(); ++i) {
      SCOPED_TRACE(model_->links[i].name);
      expect_truth(results[i], truth_of(links_[i], X_FL, points_F, cloud), config, X_FL, rounding_,
                   size);
    }
  }
}

}  // namespace ist::test
