#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>
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
  explicit TriangleGroups(std::vector<Corners3<double>> triangles)
      : triangles_(std::move(triangles)) {
    divide(0, triangles_.size());
    for (const auto& t : triangles_) spheres_.push_back(sphere_of(&t, &t + 1));
  }

  std::size_t size() const { return triangles_.size(); }

  /// [m] The distance of the surfaces; the other one is posed.
  double distance(const TriangleGroups& other, const Eigen::Isometry3d& X) const {
    std::vector<std::pair<double, std::pair<std::size_t, std::size_t>>> order;
    for (std::size_t i = 0; i < groups_.size(); ++i) {
      for (std::size_t k = 0; k < other.groups_.size(); ++k) {
        const double bound = gap(groups_[i].sphere, posed(other.groups_[k].sphere, X));
        order.push_back({bound, {i, k}});
      }
    }
    std::sort(order.begin(), order.end());
    std::vector<Corners3<double>> posed_triangles;
    std::vector<Ball> posed_balls;
    for (std::size_t i = 0; i < other.size(); ++i) {
      posed_triangles.push_back(other.triangles_[i]);
      for (auto& p : posed_triangles.back().p) p = X * p;
      posed_balls.push_back(posed(other.spheres_[i], X));
    }
    double best = std::numeric_limits<double>::infinity();
    for (const auto& [bound, pair] : order) {
      if (bound >= best) break;
      const Group &a = groups_[pair.first], &b = other.groups_[pair.second];
      for (std::size_t i = a.first; i < a.last; ++i) {
        for (std::size_t k = b.first; k < b.last; ++k) {
          if (gap(spheres_[i], posed_balls[k]) >= best) continue;
          best = std::min(best, oracle_triangles(triangles_[i], posed_triangles[k]));
        }
      }
      if (best == 0.0) break;
    }
    return best;
  }

 private:
  struct Ball {
    Eigen::Vector3d center;
    double radius;
  };
  struct Group {
    std::size_t first, last;
    Ball sphere;
  };
  static constexpr std::size_t kGroup = 48;

  static Ball posed(const Ball& ball, const Eigen::Isometry3d& X) {
    return {X * ball.center, ball.radius};
  }
  static double gap(const Ball& a, const Ball& b) {
    return (a.center - b.center).norm() - a.radius - b.radius - 1e-12;
  }
  static Ball sphere_of(const Corners3<double>* begin, const Corners3<double>* end) {
    Eigen::AlignedBox3d box;
    for (auto* t = begin; t != end; ++t) {
      for (const auto& p : t->p) box.extend(p);
    }
    Ball ball{box.center(), 0.0};
    for (auto* t = begin; t != end; ++t) {
      for (const auto& p : t->p) ball.radius = std::max(ball.radius, (p - ball.center).norm());
    }
    return ball;
  }
  void divide(std::size_t first, std::size_t last) {
    if (last - first <= kGroup) {
      groups_.push_back(
          {first, last, sphere_of(&triangles_[first], &triangles_[first] + (last - first))});
      return;
    }
    Eigen::AlignedBox3d box;
    for (std::size_t i = first; i < last; ++i) box.extend(triangles_[i].p[0]);
    Eigen::Index axis;
    box.sizes().maxCoeff(&axis);
    const std::size_t middle = (first + last) / 2;
    std::nth_element(triangles_.begin() + static_cast<std::ptrdiff_t>(first),
                     triangles_.begin() + static_cast<std::ptrdiff_t>(middle),
                     triangles_.begin() + static_cast<std::ptrdiff_t>(last),
                     [axis](const auto& a, const auto& b) { return a.p[0][axis] < b.p[0][axis]; });
    divide(first, middle);
    divide(middle, last);
  }

  std::vector<Corners3<double>> triangles_;
  std::vector<Ball> spheres_;
  std::vector<Group> groups_;
};

/// All triangles of the meshes and boxes of a link, in its frame. Other shapes are left out.
inline std::vector<Corners3<double>> triangles_of(const LinkGeometry& link) {
  std::vector<Corners3<double>> triangles;
  for (const GeometryElement& element : link) {
    if (const auto* mesh = std::get_if<TriangleMesh>(&element.shape)) {
      for (std::size_t t = 0; t < mesh->triangles.size(); ++t) {
        Corners3<double> corners;
        for (int k = 0; k < 3; ++k) corners.p[k] = element.X_LE * mesh->corner(t, k);
        triangles.push_back(corners);
      }
    } else if (const auto* box = std::get_if<Box>(&element.shape)) {
      for (int axis = 0; axis < 3; ++axis) {
        for (const double side : {-0.5, 0.5}) {
          Eigen::Vector3d corner[4];
          for (int k = 0; k < 4; ++k) {
            corner[k][axis] = side * box->size[axis];
            corner[k][(axis + 1) % 3] = (k == 1 || k == 2 ? 0.5 : -0.5) * box->size[(axis + 1) % 3];
            corner[k][(axis + 2) % 3] = (k >= 2 ? 0.5 : -0.5) * box->size[(axis + 2) % 3];
            corner[k] = element.X_LE * corner[k];
          }
          triangles.push_back({{corner[0], corner[1], corner[2]}});
          triangles.push_back({{corner[0], corner[2], corner[3]}});
        }
      }
    }
  }
  return triangles;
}

}  // namespace ist::test
