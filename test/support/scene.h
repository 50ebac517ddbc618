#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <memory>
#include <random>
#include <vector>

#include "ist_proximity/cloud/cloud_snapshot.h"
#include "ist_proximity/robot/robot_model.h"

/// Small robots and clouds for tests.
namespace ist::test {

using Rng = std::mt19937_64;

double uniform(Rng* rng, double low, double high);

Eigen::Vector3d random_vector(Rng* rng, double size);

Eigen::Isometry3d random_pose(Rng* rng, double size);

/// The pose of a place, without a turn.
inline Eigen::Isometry3d at(const Eigen::Vector3d& p) {
  return Eigen::Isometry3d(Eigen::Translation3d(p));
}
inline Eigen::Isometry3d at(double x, double y, double z) { return at({x, y, z}); }

/// A link of one element.
LinkModel make_link(const Shape& shape, double max_error);

/// A robot of one-element links.
std::shared_ptr<RobotModel> make_model(const std::vector<Shape>& shapes, double max_error);

/// A snapshot of points given in the fixed frame; their ids are their indices.
CloudSnapshot make_snapshot(const std::vector<Eigen::Vector3d>& points_F,
                            const Eigen::Vector3d& origin = Eigen::Vector3d::Zero());

}  // namespace ist::test
