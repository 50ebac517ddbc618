// Cylinder and box by GJK (Gilbert, Johnson, Keerthi 1988).

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "internal/geometry/box_distance.h"

namespace ist {
namespace {

// A point w of the Minkowski difference, cylinder minus box, and the two points it comes from.
struct Vertex {
  Eigen::Vector3d w, on_cylinder, on_box;
};

struct BoxSimplex {
  std::array<Vertex, 4> vertex;
  std::array<double, 4> weight{};
  std::size_t size = 0;

  Eigen::Vector3d nearest() const {
    Eigen::Vector3d v = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < size; ++i) v += weight[i] * vertex[i].w;
    return v;
  }
};

// Solves for the combination of columns nearest to a vector, by orthogonalization with pivoting:
// columns that the others span, to rounding, get no share.
template <std::size_t kColumns>
std::array<double, kColumns> least_squares(std::array<Eigen::Vector3d, kColumns> column,
                                           Eigen::Vector3d rest) {
  constexpr double kSpanned = 1e-15;  // of the longest column
  std::array<std::size_t, kColumns> order{};
  std::array<std::array<double, kColumns>, kColumns> r{};  // by step and column
  std::array<double, kColumns> along{}, share{};
  for (std::size_t i = 0; i < kColumns; ++i) order[i] = i;
  double longest = 0.0;
  std::size_t rank = 0;
  for (; rank < kColumns; ++rank) {
    std::size_t pivot = rank;
    for (std::size_t j = rank + 1; j < kColumns; ++j) {
      if (column[order[j]].squaredNorm() > column[order[pivot]].squaredNorm()) pivot = j;
    }
    std::swap(order[rank], order[pivot]);
    const double length = column[order[rank]].norm();
    longest = std::max(longest, length);
    if (!(length > kSpanned * longest)) break;
    const Eigen::Vector3d q = column[order[rank]] / length;
    r[rank][order[rank]] = length;
    for (int pass = 0; pass < 2; ++pass) {  // the second one removes what rounding has left
      for (std::size_t j = rank + 1; j < kColumns; ++j) {
        const double part = q.dot(column[order[j]]);
        column[order[j]] -= part * q;
        r[rank][order[j]] += part;
      }
      const double part = q.dot(rest);
      rest -= part * q;
      along[rank] += part;
    }
  }
  for (std::size_t i = rank; i-- > 0;) {
    double sum = along[i];
    for (std::size_t j = i + 1; j < rank; ++j) sum -= r[i][order[j]] * share[order[j]];
    share[order[i]] = sum / r[i][order[i]];
  }
  return share;
}

// Finds the weights of the vertices at the point of their affine hull that is nearest to the
// origin; false if that point lies outside their convex hull.
template <std::size_t kOthers>
bool solve(const BoxSimplex& face, std::array<double, 4>* weight) {
  std::array<Eigen::Vector3d, kOthers> edges;
  for (std::size_t j = 0; j < kOthers; ++j) edges[j] = face.vertex[j + 1].w - face.vertex[0].w;
  const std::array<double, kOthers> solution = least_squares<kOthers>(edges, -face.vertex[0].w);
  double first = 1.0;
  for (std::size_t j = 0; j < kOthers; ++j) {
    if (!(solution[j] >= 0.0)) return false;
    (*weight)[j + 1] = solution[j];
    first -= solution[j];
  }
  (*weight)[0] = first;
  return first >= 0.0;
}

bool solve(BoxSimplex* face) {
  switch (face->size) {
    case 1:
      face->weight[0] = 1.0;
      return true;
    case 2:
      return solve<1>(*face, &face->weight);
    case 3:
      return solve<2>(*face, &face->weight);
    default:
      return solve<3>(*face, &face->weight);
  }
}

// The face of the simplex that holds its point nearest to the origin. The point is nearer than any
// of the others without the last vertex, so the face has that one. All eight such faces are tried:
// that is robust where vertices nearly coincide, unlike a selection by Voronoi regions.
BoxSimplex nearest_face(const BoxSimplex& simplex) {
  BoxSimplex best;
  double best_sq = std::numeric_limits<double>::infinity();
  const unsigned last = 1U << (simplex.size - 1);
  for (unsigned set = last; set < 2U * last; ++set) {
    BoxSimplex face;
    for (std::size_t i = 0; i < simplex.size; ++i) {
      if ((set >> i & 1U) != 0) face.vertex[face.size++] = simplex.vertex[i];
    }
    if (!solve(&face)) continue;
    const double distance_sq = face.nearest().squaredNorm();
    if (distance_sq < best_sq) {
      best_sq = distance_sq;
      best = face;
    }
  }
  return best;
}

Eigen::Vector3d support_point(const Cylinder& cylinder, const Eigen::Isometry3d& X_OE,
                              const Eigen::Vector3d& direction_O) {
  const Eigen::Vector3d d = X_OE.linear().transpose() * direction_O;
  const double radial = std::hypot(d.x(), d.y());
  Eigen::Vector3d p(0.0, 0.0, std::copysign(0.5 * cylinder.length, d.z()));
  if (radial > 0.0) p.head<2>() = cylinder.radius / radial * d.head<2>();
  return X_OE * p;
}

}  // namespace

BoxDistance cylinder_to_box(const Cylinder& cylinder, const Eigen::Isometry3d& X_OE,
                            const Eigen::AlignedBox3d& box, double max_distance) {
  constexpr int kMaxSteps = 100;
  constexpr double kTouch = 1e-12;     // [m]
  constexpr double kResolved = 1e-13;  // of the squared distance
  BoxSimplex simplex;
  simplex.size = 1;
  simplex.weight[0] = 1.0;
  const Eigen::Vector3d center = X_OE.translation();
  simplex.vertex[0] = {center - clamp_to(box, center), center, clamp_to(box, center)};
  Eigen::Vector3d v = simplex.nearest();
  double lower_bound = 0.0;
  for (int step = 0; step < kMaxSteps && v.norm() > kTouch; ++step) {
    const Eigen::Vector3d on_cylinder = support_point(cylinder, X_OE, -v);
    const Eigen::Vector3d on_box = (v.array() > 0.0).select(box.max(), box.min());
    const Eigen::Vector3d w = on_cylinder - on_box;
    lower_bound = std::max(lower_bound, v.dot(w) / v.norm());
    if (lower_bound > max_distance) break;
    if (v.squaredNorm() - v.dot(w) <= kResolved * v.squaredNorm()) break;
    BoxSimplex larger = simplex;
    larger.vertex[larger.size++] = {w, on_cylinder, on_box};
    const BoxSimplex face = nearest_face(larger);
    const Eigen::Vector3d nearer = face.nearest();
    if (!(nearer.squaredNorm() < v.squaredNorm())) break;  // by rounding alone
    simplex = face;
    v = nearer;
    if (simplex.size == 4) break;  // the origin is inside
  }
  BoxDistance result;
  result.p_OS.setZero();
  for (std::size_t i = 0; i < simplex.size; ++i) {
    result.p_OS += simplex.weight[i] * simplex.vertex[i].on_cylinder;
  }
  result.p_OB = clamp_to(box, result.p_OS);  // at least as near as the weighted point of the box
  result.distance = (result.p_OS - result.p_OB).norm();
  if (result.distance <= kTouch || simplex.size == 4) {
    result.p_OS = result.p_OB;
    result.distance = 0.0;
  }
  result.lower_bound = std::min(lower_bound, result.distance);
  return result;
}

}  // namespace ist
