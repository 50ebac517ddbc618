#include "geometry/primitive_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ist {
namespace {

SignedDistance box_distance(const Box& box, const Eigen::Vector3d& p) {
  const Eigen::Vector3d half = 0.5 * box.size;
  const Eigen::Vector3d outside = p.cwiseAbs() - half;
  Eigen::Index axis;
  const double largest = outside.maxCoeff(&axis);
  SignedDistance result;
  result.witness = p.cwiseMax(-half).cwiseMin(half);
  const Eigen::Vector3d away = p - result.witness;
  result.distance = away.norm();
  if (largest > 0.0 && result.distance > kTouchDistance) {
    result.normal = away / result.distance;
    return result;
  }
  const double side = std::copysign(1.0, p[axis]);
  result.witness[axis] = side * half[axis];
  result.distance = largest;
  result.normal = side * Eigen::Vector3d::Unit(axis);
  return result;
}

SignedDistance cylinder_distance(const Cylinder& cylinder, const Eigen::Vector3d& p) {
  const double half = 0.5 * cylinder.length;
  const double radial = std::hypot(p.x(), p.y());
  const Eigen::Vector3d outward = radial > kTouchDistance
                                      ? Eigen::Vector3d(p.x() / radial, p.y() / radial, 0)
                                      : Eigen::Vector3d::UnitX();
  const double side = std::copysign(1.0, p.z());
  const double over_wall = radial - cylinder.radius, over_cap = std::abs(p.z()) - half;
  SignedDistance result;
  if (over_wall <= 0.0 && over_cap <= 0.0) {
    if (over_wall > over_cap) {
      result.witness = cylinder.radius * outward + p.z() * Eigen::Vector3d::UnitZ();
      result.normal = outward;
      result.distance = over_wall;
    } else {
      result.witness = {p.x(), p.y(), side * half};
      result.normal = side * Eigen::Vector3d::UnitZ();
      result.distance = over_cap;
    }
    return result;
  }
  result.witness = std::min(radial, cylinder.radius) * outward;
  if (radial <= kTouchDistance) result.witness.setZero();
  result.witness.z() = std::clamp(p.z(), -half, half);
  const Eigen::Vector3d away = p - result.witness;
  result.distance = away.norm();
  if (result.distance > kTouchDistance) {
    result.normal = away / result.distance;
  } else {
    result.normal =
        over_wall > over_cap ? outward : Eigen::Vector3d(side * Eigen::Vector3d::UnitZ());
  }
  return result;
}

SignedDistance sphere_distance(const Sphere& sphere, const Eigen::Vector3d& p) {
  const double norm = p.norm();
  SignedDistance result;
  result.normal = norm > kTouchDistance ? Eigen::Vector3d(p / norm) : Eigen::Vector3d::UnitZ();
  result.witness = sphere.radius * result.normal;
  result.distance = norm - sphere.radius;
  return result;
}

}  // namespace

SignedDistance primitive_distance(const Shape& shape, const Eigen::Vector3d& p) {
  if (const auto* box = std::get_if<Box>(&shape)) return box_distance(*box, p);
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) return cylinder_distance(*cylinder, p);
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere_distance(*sphere, p);
  return {};
}

double primitive_support(const Shape& shape, const Eigen::Vector3d& n) {
  if (const auto* box = std::get_if<Box>(&shape)) return 0.5 * box->size.dot(n.cwiseAbs());
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return cylinder->radius * std::hypot(n.x(), n.y()) + 0.5 * cylinder->length * std::abs(n.z());
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere->radius * n.norm();
  return -std::numeric_limits<double>::infinity();
}

}  // namespace ist
