#include "ray_shape.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <variant>

namespace ist::sim {
namespace {

constexpr double kMiss = std::numeric_limits<double>::infinity();
constexpr std::size_t kLeafSize = 4;

/// The part of a ray that is inside a shape.
struct Span {
  double enter, leave;

  double first_hit() const {
    if (!(enter <= leave)) return kMiss;
    return enter > 0.0 ? enter : (leave > 0.0 ? leave : kMiss);
  }
};

Span intersection(const Span& a, const Span& b) {
  return {std::max(a.enter, b.enter), std::min(a.leave, b.leave)};
}

Span slab(double origin, double direction, double min, double max) {
  if (direction == 0.0) {
    return min <= origin && origin <= max ? Span{-kMiss, kMiss} : Span{kMiss, -kMiss};
  }
  const double a = (min - origin) / direction, b = (max - origin) / direction;
  return {std::min(a, b), std::max(a, b)};
}

// The interval of a t^2 + 2 b t + c <= 0.
Span quadratic(double a, double b, double c) {
  if (a == 0.0) return c <= 0.0 ? Span{-kMiss, kMiss} : Span{kMiss, -kMiss};
  const double discriminant = b * b - a * c;
  if (discriminant < 0.0) return {kMiss, -kMiss};
  const double root = std::sqrt(discriminant);
  return {(-b - root) / a, (-b + root) / a};
}

Span span(const Ray& ray, const Eigen::Vector3d& min, const Eigen::Vector3d& max) {
  Span all{-kMiss, kMiss};
  for (int k = 0; k < 3; ++k) {
    all = intersection(all, slab(ray.origin[k], ray.direction[k], min[k], max[k]));
  }
  return all;
}

double hit_primitive(const Box& box, const Ray& ray) {
  return span(ray, -0.5 * box.size, 0.5 * box.size).first_hit();
}

double hit_primitive(const Cylinder& cylinder, const Ray& ray) {
  const Eigen::Vector2d o = ray.origin.head<2>(), d = ray.direction.head<2>();
  const Span side =
      quadratic(d.squaredNorm(), o.dot(d), o.squaredNorm() - cylinder.radius * cylinder.radius);
  const double half = 0.5 * cylinder.length;
  return intersection(side, slab(ray.origin.z(), ray.direction.z(), -half, half)).first_hit();
}

double hit_primitive(const Sphere& sphere, const Ray& ray) {
  return quadratic(ray.direction.squaredNorm(), ray.origin.dot(ray.direction),
                   ray.origin.squaredNorm() - sphere.radius * sphere.radius)
      .first_hit();
}

double hit_primitive(const TriangleMesh& /*empty*/, const Ray& /*ray*/) { return kMiss; }

double radius_of(const Box& box) { return 0.5 * box.size.norm(); }
double radius_of(const Cylinder& cylinder) {
  return std::hypot(cylinder.radius, 0.5 * cylinder.length);
}
double radius_of(const Sphere& sphere) { return sphere.radius; }
double radius_of(const TriangleMesh& /*empty*/) { return 0.0; }

}  // namespace

RayShape::RayShape(const Shape& shape) {
  if (const auto* mesh = std::get_if<TriangleMesh>(&shape)) {
    primitive_ = TriangleMesh();
    build(*mesh);
    return;
  }
  primitive_ = shape;
  radius_ = std::visit([](const auto& s) { return radius_of(s); }, shape);
}

void RayShape::build(const TriangleMesh& mesh) {
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3d &a = mesh.corner(i, 0), &b = mesh.corner(i, 1), &c = mesh.corner(i, 2);
    triangles_.push_back({a, b - a, c - a});
  }
  if (triangles_.empty()) return;
  build_node(&triangles_, 0, triangles_.size());
  center_ = 0.5 * (nodes_[0].min + nodes_[0].max);
  for (const Eigen::Vector3d& v : mesh.vertices) radius_ = std::max(radius_, (v - center_).norm());
}

void RayShape::build_node(std::vector<Triangle>* triangles, std::size_t begin, std::size_t end) {
  Node node{Eigen::Vector3d::Constant(kMiss), Eigen::Vector3d::Constant(-kMiss),
            static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end - begin)};
  for (std::size_t i = begin; i < end; ++i) {
    const Triangle& t = (*triangles)[i];
    for (const Eigen::Vector3d& p :
         {t.a, Eigen::Vector3d(t.a + t.ab), Eigen::Vector3d(t.a + t.ac)}) {
      node.min = node.min.cwiseMin(p);
      node.max = node.max.cwiseMax(p);
    }
  }
  const std::size_t at = nodes_.size();
  nodes_.push_back(node);
  if (end - begin <= kLeafSize) return;
  Eigen::Index axis = 0;
  (node.max - node.min).maxCoeff(&axis);
  const std::size_t middle = begin + (end - begin) / 2;
  std::nth_element(triangles->begin() + static_cast<std::ptrdiff_t>(begin),
                   triangles->begin() + static_cast<std::ptrdiff_t>(middle),
                   triangles->begin() + static_cast<std::ptrdiff_t>(end),
                   [axis](const Triangle& s, const Triangle& t) {
                     return 3.0 * s.a[axis] + s.ab[axis] + s.ac[axis] <
                            3.0 * t.a[axis] + t.ab[axis] + t.ac[axis];
                   });
  build_node(triangles, begin, middle);
  nodes_[at].count = 0;
  nodes_[at].first = static_cast<std::uint32_t>(nodes_.size());
  build_node(triangles, middle, end);
}

double RayShape::hit(const Ray& ray) const {
  if (!nodes_.empty()) return hit_mesh(ray);
  return std::visit([&ray](const auto& s) { return hit_primitive(s, ray); }, primitive_);
}

// Ray and triangle: Moeller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
double RayShape::hit_mesh(const Ray& ray) const {
  // Zeros are replaced, because 0 * inf is NaN.
  const Eigen::Vector3d inverse =
      ray.direction.unaryExpr([](double d) { return 1.0 / (d == 0.0 ? 1e-200 : d); });
  double nearest = kMiss;
  std::array<std::uint32_t, 64> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  while (top > 0) {
    const std::uint32_t at = stack[--top];
    const Node& node = nodes_[at];
    const Eigen::Vector3d a = (node.min - ray.origin).cwiseProduct(inverse);
    const Eigen::Vector3d b = (node.max - ray.origin).cwiseProduct(inverse);
    const double enter = a.cwiseMin(b).maxCoeff(), leave = a.cwiseMax(b).minCoeff();
    if (enter > leave || leave < 0.0 || enter >= nearest) continue;
    if (node.count == 0) {
      stack[top++] = node.first;
      stack[top++] = at + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const Triangle& t = triangles_[i];
      const Eigen::Vector3d p = ray.direction.cross(t.ac);
      const double determinant = t.ab.dot(p);
      if (determinant == 0.0) continue;
      const Eigen::Vector3d s = ray.origin - t.a;
      const double u = s.dot(p) / determinant;
      if (u < 0.0 || u > 1.0) continue;
      const Eigen::Vector3d q = s.cross(t.ab);
      const double v = ray.direction.dot(q) / determinant;
      if (v < 0.0 || u + v > 1.0) continue;
      const double distance = t.ac.dot(q) / determinant;
      if (distance > 0.0) nearest = std::min(nearest, distance);
    }
  }
  return nearest;
}

}  // namespace ist::sim
