#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <memory>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"
#include "support/scene.h"

/// Checks of a query's answers against the oracle: everything that an answer guarantees.
namespace ist::test {

/// The true distances of a link.
struct Truth {
  double measured;  ///< [m] smallest signed distance of the points as given
  double stored;    ///< [m] of the points as the index holds them
};

Truth truth_of(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
               const std::vector<Eigen::Vector3d>& points_F, const CloudSnapshot& cloud);

/// Expects witness points and direction that fit each other, all finite.
void expect_witness(const LinkProximity& result, const Eigen::Isometry3d& X_FL, double scale = 1.0);

/// Expects the right state, bounds, interval width and witness points of a complete answer.
/// @param rounding  [m] of double precision, and of float where it decides on which side of a mesh
///                  a point lies
/// @param size      [m] of the link, where it is large
void expect_truth(const LinkProximity& result, const Truth& truth, const QueryConfig& config,
                  const Eigen::Isometry3d& X_FL, double rounding = 2e-8, double size = 1.0);

/// Links packed with `max_error`, queried without a warm start at tolerance 0 and 1 mm, against the
/// oracle.
class Trial {
 public:
  explicit Trial(const std::vector<Shape>& shapes, double max_error = 0.005,
                 double rounding = 2e-8);

  /// @param model  of the same links, packed by the caller
  Trial(std::shared_ptr<const RobotModel> model, std::vector<LinkGeometry> links, double rounding);

  double max_distance = 1.0;  ///< [m]
  double size = 1.0;          ///< [m] of the links, where they are large

  const RobotModel& model() const { return *model_; }
  const std::shared_ptr<const RobotModel>& shared_model() const { return model_; }
  const LinkGeometry& link(std::size_t i) const { return links_[i]; }

  void expect(const std::vector<Eigen::Vector3d>& points_F,
              const Eigen::Isometry3d& X_FL = Eigen::Isometry3d::Identity(),
              const Eigen::Vector3d& origin = Eigen::Vector3d::Zero()) const;

 private:
  std::shared_ptr<const RobotModel> model_;
  std::vector<LinkGeometry> links_;
  double rounding_;
};

}  // namespace ist::test
