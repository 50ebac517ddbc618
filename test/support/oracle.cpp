#include "support/oracle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace ist::test {
namespace {

// Whether a point is in the axis-aligned box about a mesh, which holds all that counts as inside.
bool oracle_box_contains(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  Eigen::Array3d low = Eigen::Array3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::Array3d high = -low;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      low = low.min(mesh.corner(t, k).array());
      high = high.max(mesh.corner(t, k).array());
    }
  }
  return (p.array() >= low).all() && (p.array() <= high).all();
}

}  // namespace

double oracle_winding(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  double sum = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d a = mesh.corner(t, 0) - p, b = mesh.corner(t, 1) - p,
                          c = mesh.corner(t, 2) - p;
    const double la = a.norm(), lb = b.norm(), lc = c.norm();
    sum += 2.0 * std::atan2(a.dot(b.cross(c)),
                            la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
  }
  return sum / (4.0 * EIGEN_PI);
}

double oracle_segment(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                      const Eigen::Vector3d& b) {
  const Eigen::Vector3d ab = b - a;
  const double length_sq = ab.squaredNorm();
  const double s = length_sq > 0.0 ? std::clamp((p - a).dot(ab) / length_sq, 0.0, 1.0) : 0.0;
  return (a + s * ab - p).norm();
}

double oracle_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c) {
  const Eigen::Vector3d n = (b - a).cross(c - a);
  const double edges =
      std::min({oracle_segment(p, a, b), oracle_segment(p, b, c), oracle_segment(p, c, a)});
  if (n.squaredNorm() < 1e-30) return edges;
  const bool inside = n.dot((b - a).cross(p - a)) >= 0.0 && n.dot((c - b).cross(p - b)) >= 0.0 &&
                      n.dot((a - c).cross(p - c)) >= 0.0;
  return inside ? std::min(edges, std::abs(n.normalized().dot(p - a))) : edges;
}

double oracle_distance(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    nearest = std::min(nearest,
                       oracle_triangle(p, mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2)));
  }
  return nearest;
}

double oracle_signed_distance(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  const double distance = oracle_distance(mesh, p);
  return oracle_box_contains(mesh, p) && oracle_winding(mesh, p) > 0.5 ? -distance : distance;
}

double oracle_minimum(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& points) {
  double smallest = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3d& p : points) {
    smallest = std::min(smallest, oracle_signed_distance(mesh, p));
  }
  return smallest;
}

}  // namespace ist::test
