#include "contact/outward_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <tuple>

#include "internal/geometry/tessellation.h"

namespace ist {
namespace {

constexpr double kSamples = 3000.0;    // of a link, about
constexpr int kMostHalvings = 20;      // of a triangle
constexpr double kTessellated = 0.02;  // of a primitive's size: deviation of its samples
// The mean over a plane, of directions at an angle to its normal, is 2/3 of unit length.
constexpr double kPlane = 1.5;

TriangleMesh surface(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) return tessellate(*box).mesh;
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return tessellate(*cylinder, kTessellated * cylinder->radius).mesh;
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    return tessellate(*sphere, kTessellated * sphere->radius).mesh;
  }
  return std::get<TriangleMesh>(shape);
}

struct CellSum {
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double area = 0.0;
};
// By cell, and the side that the triangle faces, so that a thin plate keeps both.
using Cells = std::map<std::tuple<std::int64_t, std::int64_t, std::int64_t, int>, CellSum>;
using Corners = std::array<Eigen::Vector3d, 3>;

// Adds a triangle to the cells: halves the longest edge until it is no longer than a cell.
void gather(const Corners& corners, int side, double area, double spacing, int halvings,
            Cells* cells) {
  std::size_t longest = 0;
  double length = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double edge = (corners[(k + 1) % 3] - corners[k]).norm();
    if (edge > length) {
      length = edge;
      longest = k;
    }
  }
  if (length <= spacing || halvings == 0) {
    const Eigen::Vector3d p = (corners[0] + corners[1] + corners[2]) / 3.0;
    const Eigen::Vector3d cell = (p / spacing).array().floor();
    CellSum& sum =
        (*cells)[{static_cast<std::int64_t>(cell.x()), static_cast<std::int64_t>(cell.y()),
                  static_cast<std::int64_t>(cell.z()), side}];
    sum.moment += area * p;
    sum.area += area;
    return;
  }
  const std::size_t next = (longest + 1) % 3;
  const Eigen::Vector3d middle = 0.5 * (corners[longest] + corners[next]);
  Corners first = corners, second = corners;
  first[next] = second[longest] = middle;
  gather(first, side, 0.5 * area, spacing, halvings - 1, cells);
  gather(second, side, 0.5 * area, spacing, halvings - 1, cells);
}

double area_of(const TriangleMesh& mesh) {
  double area = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d& a = mesh.corner(t, 0);
    area += 0.5 * (mesh.corner(t, 1) - a).cross(mesh.corner(t, 2) - a).norm();
  }
  return area;
}

}  // namespace

OutwardField::OutwardField(const LinkGeometry& geometry, const Solid& solid) {
  std::vector<TriangleMesh> meshes;
  double area = 0.0;
  for (const GeometryElement& element : geometry) {
    meshes.push_back(surface(element.shape));
    area += area_of(meshes.back());
  }
  spacing_ = std::sqrt(area / kSamples);
  if (!(spacing_ > 0.0)) return;
  for (std::size_t e = 0; e < geometry.size(); ++e) add(meshes[e], geometry[e].X_LE);
  if (geometry.size() < 2) return;
  std::size_t count = 0;
  for (std::size_t i = 0; i < x_.size(); ++i) {
    const Eigen::Vector3d p(x_[i], y_[i], z_[i]);
    if (solid.signed_distance(p).distance < -spacing_) continue;
    x_[count] = x_[i];
    y_[count] = y_[i];
    z_[count] = z_[i];
    area_[count++] = area_[i];
  }
  for (std::vector<float>* values : {&x_, &y_, &z_, &area_}) values->resize(count);
}

// Large triangles become many samples, small ones that face the same side are gathered in cells.
void OutwardField::add(const TriangleMesh& mesh, const Eigen::Isometry3d& X_LE) {
  Cells cells;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Corners corners = {X_LE * mesh.corner(t, 0), X_LE * mesh.corner(t, 1),
                             X_LE * mesh.corner(t, 2)};
    const Eigen::Vector3d normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
    Eigen::Index axis;
    normal.cwiseAbs().maxCoeff(&axis);
    const int side = 2 * static_cast<int>(axis) + (normal[axis] > 0.0 ? 1 : 0);
    gather(corners, side, 0.5 * normal.norm(), spacing_, kMostHalvings, &cells);
  }
  for (const auto& [cell, sum] : cells) {
    if (!(sum.area > 0.0)) continue;
    const Eigen::Vector3d p = sum.moment / sum.area;
    x_.push_back(static_cast<float>(p.x()));
    y_.push_back(static_cast<float>(p.y()));
    z_.push_back(static_cast<float>(p.z()));
    area_.push_back(static_cast<float>(sum.area / (spacing_ * spacing_)));
  }
}

Eigen::Vector3d OutwardField::at(const Eigen::Vector3d& p_L) const {
  const Eigen::Vector3f p = p_L.cast<float>();
  // Softens the weight at distances below the spacing, so that no single sample decides.
  const auto soft = static_cast<float>(0.25 * spacing_ * spacing_);
  float sx = 0.0F, sy = 0.0F, sz = 0.0F, all = 0.0F;
  const auto scale = static_cast<float>(spacing_ * spacing_);
  for (std::size_t i = 0; i < x_.size(); ++i) {
    const float dx = x_[i] - p.x(), dy = y_[i] - p.y(), dz = z_[i] - p.z();
    const float squared = scale / (dx * dx + dy * dy + dz * dz + soft);
    const float weight = area_[i] * squared * squared;
    const float directed = weight * std::sqrt(squared);
    sx += directed * dx;
    sy += directed * dy;
    sz += directed * dz;
    all += weight;
  }
  if (!(all > 0.0F)) return Eigen::Vector3d::Zero();
  return kPlane / (static_cast<double>(all) * spacing_) *
         Eigen::Vector3f(sx, sy, sz).cast<double>();
}

Eigen::Matrix3d OutwardField::gradient(const Eigen::Vector3d& center, double radius) const {
  const double step = 0.5 * radius;
  Eigen::Matrix3d result;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d offset = step * Eigen::Vector3d::Unit(axis);
    result.col(axis) = (at(center + offset) - at(center - offset)) / (2.0 * step);
  }
  return result;
}

}  // namespace ist
