#include "ist_proximity/geometry/triangle_bvh.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace ist {
namespace {

constexpr double kFourPi = 12.566370614359172;
constexpr std::uint32_t kLeafSize = 4;
constexpr int kMaxDepth = 48;  // median splits: deeper than any mesh that fits in memory needs

// The expansion is used where the query point is at least beta radii away.
constexpr double kQuickBeta = 2.0;
constexpr double kBeta = 6.0;

/// A complex number whose argument is an angle.
struct Phasor {
  double re, im;
};

/// Half the solid angle of triangle abc seen from p (van Oosterom and Strackee 1983).
Phasor half_solid_angle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                        const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d u = a - p, v = b - p, w = c - p;
  const double nu = u.norm(), nv = v.norm(), nw = w.norm();
  const double numerator = u.dot(v.cross(w));
  if (numerator == 0.0) return {1.0, 0.0};  // in the triangle's plane: half of it on either side
  return {nu * nv * nw + u.dot(v) * nw + v.dot(w) * nu + w.dot(u) * nv, numerator};
}

/// Adds angles by multiplying their phasors: one arctangent for many small angles.
class AngleSum {
 public:
  void add(const Phasor& angle) {
    const Phasor product{product_.re * angle.re - product_.im * angle.im,
                         product_.re * angle.im + product_.im * angle.re};
    // Both below a right angle: the sum cannot wrap. Past it, it is put aside.
    if (angle.re > 0.0 && product.re > 0.0) {
      product_ = product;
      return;
    }
    sum_ += std::atan2(product_.im, product_.re) + std::atan2(angle.im, angle.re);
    product_ = {1.0, 0.0};
  }
  /// Keeps the product in range; to be called every few factors.
  void rescale() {
    const double size = std::abs(product_.re) + std::abs(product_.im);
    product_ = size > 0.0 ? Phasor{product_.re / size, product_.im / size} : Phasor{1.0, 0.0};
  }
  double value() const { return sum_ + std::atan2(product_.im, product_.re); }

 private:
  Phasor product_{1.0, 0.0};
  double sum_ = 0.0;
};

double squared_distance(const Eigen::AlignedBox3d& box, const Eigen::Vector3d& p) {
  const Eigen::Vector3d outside =
      (box.min() - p).cwiseMax(p - box.max()).cwiseMax(Eigen::Vector3d::Zero());
  return outside.squaredNorm();
}

}  // namespace

Eigen::Vector3d closest_point_on_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                          const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a, ap = p - a;
  const double d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Eigen::Vector3d bp = p - b;
  const double d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + (d1 / std::max(d1 - d3, 1e-300)) * ab;
  const Eigen::Vector3d cp = p - c;
  const double d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + (d2 / std::max(d2 - d6, 1e-300)) * ac;
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0) {
    return b + ((d4 - d3) / std::max((d4 - d3) + (d5 - d6), 1e-300)) * (c - b);
  }
  const double denominator = 1.0 / (va + vb + vc);
  return a + ab * (vb * denominator) + ac * (vc * denominator);
}

double winding_of_triangle(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                           const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  AngleSum sum;
  sum.add(half_solid_angle(p, a, b, c));
  return 2.0 * sum.value() / kFourPi;
}

TriangleBvh::TriangleBvh(const TriangleMesh& mesh) {
  triangles_.reserve(mesh.triangles.size());
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    triangles_.push_back({mesh.corner(t, 0), mesh.corner(t, 1), mesh.corner(t, 2), t});
  }
  if (triangles_.empty()) return;
  nodes_.reserve(triangles_.size());
  build(0, static_cast<std::uint32_t>(triangles_.size()), 0);
}

std::uint32_t TriangleBvh::build(std::uint32_t first, std::uint32_t last, int depth) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Eigen::AlignedBox3d box, centroids;
  for (std::uint32_t t = first; t < last; ++t) {
    const Triangle& triangle = triangles_[t];
    box.extend(triangle.a).extend(triangle.b).extend(triangle.c);
    centroids.extend((triangle.a + triangle.b + triangle.c) / 3.0);
  }
  nodes_[index].box = box;
  if (last - first <= kLeafSize || depth >= kMaxDepth) {
    nodes_[index].first = first;
    nodes_[index].count = last - first;
  } else {
    Eigen::Index axis;
    centroids.sizes().maxCoeff(&axis);
    const std::uint32_t middle = first + (last - first) / 2;
    const auto key = [axis](const Triangle& t) { return t.a[axis] + t.b[axis] + t.c[axis]; };
    std::nth_element(triangles_.begin() + first, triangles_.begin() + middle,
                     triangles_.begin() + last, [&](const Triangle& s, const Triangle& t) {
                       const double ks = key(s), kt = key(t);
                       return ks < kt || (ks == kt && s.index < t.index);
                     });
    build(first, middle, depth + 1);
    const std::uint32_t right = build(middle, last, depth + 1);
    nodes_[index].first = right;
  }
  sum_moments(index);
  return index;
}

// Moments about the area-weighted centroid, bottom up (Barill et al. 2018, eq. 9 to 12).
void TriangleBvh::sum_moments(std::uint32_t index) {
  Node& node = nodes_[index];
  double area = 0.0;
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero();
  if (node.count > 0) {
    for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
      const Triangle& s = triangles_[t];
      const Eigen::Vector3d normal = 0.5 * (s.b - s.a).cross(s.c - s.a);
      area += normal.norm();
      weighted += normal.norm() * (s.a + s.b + s.c) / 3.0;
      node.dipole += normal;
    }
  } else {
    for (const std::uint32_t child : {index + 1, node.first}) {
      // The bounding radius stands in for the area: only the centre's quality depends on it.
      const double weight = std::max(nodes_[child].dipole.norm(), 1e-3 * nodes_[child].radius *
                                                                      nodes_[child].radius);
      area += weight;
      weighted += weight * nodes_[child].dipole_center;
      node.dipole += nodes_[child].dipole;
    }
  }
  node.dipole_center = area > 0.0 ? Eigen::Vector3d(weighted / area) : node.box.center();
  const Eigen::Vector3d far_corner = (node.box.max() - node.dipole_center)
                                         .cwiseAbs()
                                         .cwiseMax((node.box.min() - node.dipole_center).cwiseAbs());
  node.radius = far_corner.norm();
  if (node.count > 0) {
    for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
      const Triangle& s = triangles_[t];
      const Eigen::Vector3d normal = 0.5 * (s.b - s.a).cross(s.c - s.a);
      node.quadrupole += ((s.a + s.b + s.c) / 3.0 - node.dipole_center) * normal.transpose();
    }
  } else {
    for (const std::uint32_t child : {index + 1, node.first}) {
      node.quadrupole += nodes_[child].quadrupole +
                         (nodes_[child].dipole_center - node.dipole_center) *
                             nodes_[child].dipole.transpose();
    }
  }
}

ClosestPoint TriangleBvh::closest(const Eigen::Vector3d& p_M, double max_distance_sq) const {
  ClosestPoint best;
  if (nodes_.empty()) return best;
  struct Entry {
    std::uint32_t node;
    double distance_sq;
  };
  std::array<Entry, kMaxDepth + 2> stack;
  std::size_t top = 0;
  double bound = max_distance_sq;
  stack[top++] = {0, squared_distance(nodes_[0].box, p_M)};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (entry.distance_sq > bound) continue;
    const Node& node = nodes_[entry.node];
    if (node.count > 0) {
      for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
        const Triangle& s = triangles_[t];
        const Eigen::Vector3d q = closest_point_on_triangle(p_M, s.a, s.b, s.c);
        const double distance_sq = (q - p_M).squaredNorm();
        if (distance_sq < bound || (distance_sq == bound && best.distance_sq > bound)) {
          bound = distance_sq;
          best = {q, distance_sq, s.index};
        }
      }
      continue;
    }
    Entry near{entry.node + 1, squared_distance(nodes_[entry.node + 1].box, p_M)};
    Entry far{node.first, squared_distance(nodes_[node.first].box, p_M)};
    if (far.distance_sq < near.distance_sq) std::swap(near, far);
    assert(top + 2 <= stack.size());
    if (far.distance_sq <= bound) stack[top++] = far;
    if (near.distance_sq <= bound) stack[top++] = near;
  }
  return best;
}

double TriangleBvh::winding(const Eigen::Vector3d& p_M, double beta) const {
  if (nodes_.empty()) return 0.0;
  std::array<std::uint32_t, kMaxDepth + 2> stack;
  std::size_t top = 0;
  stack[top++] = 0;
  double sum = 0.0;
  AngleSum angles;
  while (top > 0) {
    const std::uint32_t index = stack[--top];
    const Node& node = nodes_[index];
    const Eigen::Vector3d d = node.dipole_center - p_M;
    const double distance_sq = d.squaredNorm();
    if (distance_sq > beta * beta * node.radius * node.radius) {
      const double inverse = 1.0 / std::sqrt(distance_sq);
      const double inverse3 = inverse * inverse * inverse / kFourPi;
      sum += inverse3 * (node.dipole.dot(d) + node.quadrupole.trace() -
                         3.0 * inverse * inverse * d.dot(node.quadrupole * d));
    } else if (node.count > 0) {
      for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
        angles.add(half_solid_angle(p_M, triangles_[t].a, triangles_[t].b, triangles_[t].c));
      }
      angles.rescale();
    } else {
      stack[top++] = index + 1;
      stack[top++] = node.first;
    }
  }
  return sum + 2.0 * angles.value() / kFourPi;
}

double TriangleBvh::winding_number(const Eigen::Vector3d& p_M) const {
  return winding(p_M, kBeta);
}

double TriangleBvh::quick_winding_number(const Eigen::Vector3d& p_M) const {
  return winding(p_M, kQuickBeta);
}

bool TriangleBvh::is_inside(const Eigen::Vector3d& p_M) const {
  if (nodes_.empty()) return false;
  const double w = winding(p_M, kQuickBeta);
  if (std::abs(w - 0.5) > kQuickWindingError) return w > 0.5;
  return winding(p_M, kBeta) > 0.5;
}

}  // namespace ist
