#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

/// Brute force for the distance of two meshes: every triangle against every triangle, but for
/// groups of triangles whose bounding spheres are too far. It shares no code with the library.
namespace ist::test {

template <typename T>
using Point3 = Eigen::Matrix<T, 3, 1>;

template <typename T>
struct Corners3 {
  Point3<T> p[3];
};

/// The distance of two segments, by the four ends and the common perpendicular.
template <typename T>
T oracle_point_to_segment(const Point3<T>& p, const Point3<T>& a, const Point3<T>& b) {
  const Point3<T> ab = b - a;
  const T length_sq = ab.squaredNorm();
  const T t = length_sq > 0 ? std::min(std::max((p - a).dot(ab) / length_sq, T(0)), T(1)) : T(0);
  return (a + t * ab - p).norm();
}

template <typename T>
T oracle_segments(const Point3<T>& a, const Point3<T>& b, const Point3<T>& c, const Point3<T>& d) {
  T best = std::min({oracle_point_to_segment(a, c, d), oracle_point_to_segment(b, c, d),
                     oracle_point_to_segment(c, a, b), oracle_point_to_segment(d, a, b)});
  const Point3<T> u = b - a, v = d - c, n = u.cross(v);
  const T n_sq = n.squaredNorm();
  if (!(n_sq > 0)) return best;
  const T s = (c - a).cross(v).dot(n) / n_sq, t = (c - a).cross(u).dot(n) / n_sq;
  if (s >= 0 && s <= 1 && t >= 0 && t <= 1) {
    best = std::min(best, (a + s * u - c - t * v).norm());
  }
  return best;
}

/// Projects p onto the plane of a triangle; inf where that falls outside it.
template <typename T>
T oracle_height(const Point3<T>& p, const Corners3<T>& t) {
  const Point3<T> n = (t.p[1] - t.p[0]).cross(t.p[2] - t.p[0]);
  for (int k = 0; k < 3; ++k) {
    if (n.dot((t.p[(k + 1) % 3] - t.p[k]).cross(p - t.p[k])) < 0) {
      return std::numeric_limits<T>::infinity();
    }
  }
  return n.norm() > 0 ? std::abs(n.dot(p - t.p[0])) / n.norm() : std::numeric_limits<T>::infinity();
}

/// Whether the segment ab passes through a triangle.
template <typename T>
bool oracle_pierces(const Point3<T>& a, const Point3<T>& b, const Corners3<T>& t) {
  const Point3<T> n = (t.p[1] - t.p[0]).cross(t.p[2] - t.p[0]);
  const T from_a = n.dot(a - t.p[0]), from_b = n.dot(b - t.p[0]);
  if (!(from_a * from_b < 0)) return false;
  return oracle_height<T>(a + from_a / (from_a - from_b) * (b - a), t) <
         std::numeric_limits<T>::infinity();
}

/// 0 where they intersect.
template <typename T>
T oracle_triangles(const Corners3<T>& a, const Corners3<T>& b) {
  T best = std::numeric_limits<T>::infinity();
  for (int i = 0; i < 3; ++i) {
    best = std::min({best, oracle_height(a.p[i], b), oracle_height(b.p[i], a)});
    if (oracle_pierces(a.p[i], a.p[(i + 1) % 3], b)) return 0;
    if (oracle_pierces(b.p[i], b.p[(i + 1) % 3], a)) return 0;
    for (int k = 0; k < 3; ++k) {
      best = std::min(best, oracle_segments(a.p[i], a.p[(i + 1) % 3], b.p[k], b.p[(k + 1) % 3]));
    }
  }
  return best;
}

/// The triangles of a link, in groups.
class TriangleGroups {
 public:
  explicit TriangleGroups(std::vector<Corners3<double>> triangles);

  std::size_t size() const { return triangles_.size(); }

  /// [m] The distance of the surfaces; the other one is posed.
  double distance(const TriangleGroups& other, const Eigen::Isometry3d& X) const;

  /// Whether a part of the other link is inside this one, by the winding number of one corner of
  /// each of its groups; for closed links whose surfaces are apart. A component of the surface that
  /// shares every group with others may be missed.
  bool holds_part_of(const TriangleGroups& other, const Eigen::Isometry3d& X) const;

  /// Whether the winding number of the surface about the point is more than a half.
  bool contains(const Eigen::Vector3d& p) const;

 private:
  struct Ball {
    Eigen::Vector3d center;
    double radius;
    Eigen::Vector3d half = Eigen::Vector3d::Zero();  // of the box with this centre, unposed
  };
  // A sphere about some triangles, in two halves or, with `right` 0, a few.
  struct Group {
    std::size_t first, last;
    Ball sphere;
    std::size_t right = 0;  // the left half follows its parent
  };
  static constexpr std::size_t kGroup = 6;

  static Ball posed(const Ball& ball, const Eigen::Isometry3d& X);
  // The width of the slab between two triangles that is perpendicular to n.
  static double slab(const Eigen::Vector3d& n, const Corners3<double>& a,
                     const Corners3<double>& b);
  // The same between the boxes about two groups, along the line of their centres.
  static double slab(const Ball& a, const Ball& b, const Eigen::Isometry3d& X);
  static double bound(const Group& a, const Group& b, const Eigen::Isometry3d& X);
  static double gap(const Ball& a, const Ball& b);
  static Ball sphere_of(const Corners3<double>* begin, const Corners3<double>* end);
  static Eigen::Vector3d normal(const Corners3<double>& t);

  void compare(const Group& a, const TriangleGroups& other, const Group& b,
               const Eigen::Isometry3d& X, double* best) const;

  // The larger group is halved, and the nearer half comes first.
  void descend(std::size_t a, const TriangleGroups& other, std::size_t b,
               const Eigen::Isometry3d& X, double* best) const;

  void divide(std::size_t first, std::size_t last);

  std::vector<Corners3<double>> triangles_;
  std::vector<Ball> spheres_;
  std::vector<Group> groups_;
  Eigen::AlignedBox3d box_;
};

/// All triangles of the meshes and boxes of a link, in its frame. Other shapes are left out.
std::vector<Corners3<double>> triangles_of(const LinkGeometry& link);

/// Appends inscribed triangles of the cylinders and spheres of a link.
/// @returns [m] no point of those is farther from the triangles
double append_round_shapes(const LinkGeometry& link, std::vector<Corners3<double>>* triangles);

}  // namespace ist::test
