#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "ist_proximity/geometry/shapes.h"

/// Distances by brute force in a floating-point type that has more digits than double: for
/// triangles so thin that double is not above what is tested.
namespace ist::test {

template <class Real>
using RealVector = std::array<Real, 3>;

template <class Real>
RealVector<Real> real(const Eigen::Vector3d& v) {
  return {Real(v.x()), Real(v.y()), Real(v.z())};
}
template <class Real>
RealVector<Real> minus(const RealVector<Real>& a, const RealVector<Real>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
template <class Real>
Real dot(const RealVector<Real>& a, const RealVector<Real>& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
template <class Real>
RealVector<Real> cross(const RealVector<Real>& a, const RealVector<Real>& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// [m^2] Squared distance of a triangle and p.
template <class Real>
Real exact_triangle_sq(const RealVector<Real>& p, const std::array<RealVector<Real>, 3>& corner) {
  std::array<RealVector<Real>, 3> edge;
  std::array<Real, 3> length_sq;
  Real nearest_sq = std::numeric_limits<double>::infinity();
  RealVector<Real> off{};  // from the closest point of the edges to p
  for (std::size_t k = 0; k < 3; ++k) {
    edge[k] = minus(corner[(k + 1) % 3], corner[k]);
    length_sq[k] = dot(edge[k], edge[k]);
    RealVector<Real> to_p = minus(p, corner[k]);
    const Real along = dot(to_p, edge[k]);
    Real s = 0;
    if (along > 0 && length_sq[k] > 0) s = along < length_sq[k] ? along / length_sq[k] : Real(1);
    for (std::size_t i = 0; i < 3; ++i) to_p[i] -= s * edge[k][i];
    if (dot(to_p, to_p) >= nearest_sq) continue;
    nearest_sq = dot(to_p, to_p);
    off = to_p;
  }
  // The two shorter edges give the most certain normal.
  const auto longest = static_cast<std::size_t>(
      std::max_element(length_sq.begin(), length_sq.end()) - length_sq.begin());
  const RealVector<Real> n = cross(edge[(longest + 1) % 3], edge[(longest + 2) % 3]);
  const Real n_sq = dot(n, n);
  if (!(n_sq > 0)) return nearest_sq;
  for (std::size_t k = 0; k < 3; ++k) {
    if (dot(n, cross(edge[k], minus(p, corner[k]))) < 0) return nearest_sq;
  }
  const Real height = dot(n, off);
  return std::min<Real>(nearest_sq, height * height / n_sq);
}

/// [m] Distance of p and a mesh. In long double the normal of a triangle of length L and height h
/// is exact to 1e-19 L / h.
template <class Real = long double>
double exact_distance(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  static_assert(sizeof(Real) > sizeof(double));
  Real least = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    least =
        std::min(least, exact_triangle_sq<Real>(real<Real>(p), {real<Real>(mesh.corner(t, 0)),
                                                                real<Real>(mesh.corner(t, 1)),
                                                                real<Real>(mesh.corner(t, 2))}));
  }
  return static_cast<double>(std::sqrt(static_cast<long double>(least)));
}

/// [m] Signed distance of p and a convex mesh.
inline double exact_signed_distance(const TriangleMesh& mesh, const Eigen::Vector3d& p) {
  bool is_inside = true;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const RealVector<long double> a = real<long double>(mesh.corner(t, 0));
    const RealVector<long double> n = cross(minus(real<long double>(mesh.corner(t, 1)), a),
                                            minus(real<long double>(mesh.corner(t, 2)), a));
    is_inside = is_inside && dot(n, minus(real<long double>(p), a)) <= 0;
  }
  return (is_inside ? -1.0 : 1.0) * exact_distance(mesh, p);
}

}  // namespace ist::test
