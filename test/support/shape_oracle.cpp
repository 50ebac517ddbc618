#include "support/shape_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

#include "support/tiles.h"

namespace ist::test {

double oracle_signed_distance(const Box& box, const Eigen::Vector3d& p) {
  const Eigen::Vector3d q = p.cwiseAbs() - 0.5 * box.size;
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

double oracle_signed_distance(const Cylinder& cylinder, const Eigen::Vector3d& p) {
  const Eigen::Vector2d q(p.head<2>().norm() - cylinder.radius,
                          std::abs(p.z()) - 0.5 * cylinder.length);
  return q.cwiseMax(0.0).norm() + std::min(q.maxCoeff(), 0.0);
}

double oracle_signed_distance(const Sphere& sphere, const Eigen::Vector3d& p) {
  return p.norm() - sphere.radius;
}

double oracle_signed_distance(const LinkGeometry& link, const Eigen::Vector3d& p_L) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const GeometryElement& element : link) {
    const Eigen::Vector3d p_E = element.X_LE.inverse() * p_L;
    smallest = std::min(
        smallest,
        std::visit([&](const auto& s) { return oracle_signed_distance(s, p_E); }, element.shape));
  }
  return smallest;
}

double oracle_minimum(const LinkGeometry& link, const Eigen::Isometry3d& X_FL,
                      const std::vector<Eigen::Vector3d>& points_F) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const GeometryElement& element : link) {
    const Eigen::Isometry3d X_EF = (X_FL * element.X_LE).inverse();
    std::vector<Eigen::Vector3d> points_E;
    points_E.reserve(points_F.size());
    for (const Eigen::Vector3d& p_F : points_F) points_E.push_back(X_EF * p_F);
    if (const auto* mesh = std::get_if<TriangleMesh>(&element.shape)) {
      smallest = std::min(smallest, oracle_minimum(*mesh, points_E));
      continue;
    }
    for (const Eigen::Vector3d& p_E : points_E) {
      smallest = std::min(
          smallest,
          std::visit([&](const auto& s) { return oracle_signed_distance(s, p_E); }, element.shape));
    }
  }
  return smallest;
}

std::vector<Eigen::Vector3d> stored_points(const PointIndex& index) {
  std::vector<Eigen::Vector3d> points;
  points.reserve(index.size());
  for (const PointTile& tile : tiles_of(index)) {
    for (int k = 0; k < tile.count; ++k) {
      points.push_back(index.X_FO() * tile.point(static_cast<int>(k)));
    }
  }
  return points;
}

}  // namespace ist::test
