#include "support/oracle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "support/link_pair_oracle.h"

namespace ist::test {
namespace {

// The axis-aligned box about a mesh's triangles, which holds all that counts as inside.
Eigen::AlignedBox3d box_about(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) box.extend(mesh.corner(t, k));
  }
  return box;
}

}  // namespace

double oracle_solid_angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                          const Eigen::Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  return 2.0 * std::atan2(a.dot(b.cross(c)),
                          la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

double oracle_winding(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  double sum = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    sum += oracle_solid_angle(mesh.corner(t, 0) - p, mesh.corner(t, 1) - p, mesh.corner(t, 2) - p);
  }
  return sum / (4.0 * EIGEN_PI);
}

double oracle_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c) {
  const Eigen::Vector3d n = (b - a).cross(c - a);
  const double edges = std::min({oracle_point_to_segment(p, a, b), oracle_point_to_segment(p, b, c),
                                 oracle_point_to_segment(p, c, a)});
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
  return box_about(mesh).contains(p) && oracle_winding(mesh, p) > 0.5 ? -distance : distance;
}

double oracle_minimum(const TriangleMesh& mesh, const std::vector<Eigen::Vector3d>& points) {
  const Eigen::AlignedBox3d box = box_about(mesh);
  double smallest = std::numeric_limits<double>::infinity();
  std::vector<std::pair<double, const Eigen::Vector3d*>> in_box;  // with their distances
  for (const Eigen::Vector3d& p : points) {
    if (box.contains(p)) {
      in_box.emplace_back(oracle_distance(mesh, p), &p);
    } else if (box.exteriorDistance(p) < smallest) {
      smallest = std::min(smallest, oracle_distance(mesh, p));
    }
  }
  // Of points in the box the first one that is inside is the deepest.
  std::sort(in_box.rbegin(), in_box.rend());
  for (const auto& [distance, p] : in_box) {
    if (oracle_winding(mesh, *p) > 0.5) return -distance;
    smallest = std::min(smallest, distance);
  }
  return smallest;
}

}  // namespace ist::test
