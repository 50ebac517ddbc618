#include "ist_proximity/geometry/box_distance.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace ist {
namespace {

// Flatter than this (height over length) a triangle's plane is left to its edges.
constexpr double kNoArea = 1e-8;

BoxDistance from_point(const Eigen::Vector3d& p, const Eigen::AlignedBox3d& box) {
  BoxDistance result;
  result.p_OS = p;
  result.p_OB = clamp_to(box, p);
  result.distance = result.lower_bound = (result.p_OS - result.p_OB).norm();
  return result;
}

// Half the derivative of the squared distance along a + t d: grows with t, linear between the
// places where the segment passes a side's plane.
double slope(const Eigen::Vector3d& a, const Eigen::Vector3d& d, double t,
             const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d p = a + t * d;
  return d.dot(p - clamp_to(box, p));
}

bool projects_inside(const Eigen::Vector3d& p, const Eigen::Vector3d& n,
                     const std::array<Eigen::Vector3d, 3>& corner) {
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d& from = corner[k];
    if (n.dot((corner[(k + 1) % 3] - from).cross(p - from)) < 0.0) return false;
  }
  return true;
}

}  // namespace

BoxDistance segment_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                           const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d d = b - a;
  double t0 = 0.0, slope0 = slope(a, d, 0.0, box);
  if (!(slope0 < 0.0)) return from_point(a, box);
  double t1 = 1.0, slope1 = slope(a, d, 1.0, box);
  if (!(slope1 > 0.0)) return from_point(b, box);
  // Narrows [t0, t1] to a piece where the slope is linear and changes its sign.
  for (int axis = 0; axis < 3; ++axis) {
    for (const double side : {box.min()[axis], box.max()[axis]}) {
      const double t = (side - a[axis]) / d[axis];
      if (!(t > t0 && t < t1)) continue;  // inf and NaN too, where d is 0
      const double s = slope(a, d, t, box);
      (s < 0.0 ? t0 : t1) = t;
      (s < 0.0 ? slope0 : slope1) = s;
    }
  }
  const double t = t0 + (t1 - t0) * std::clamp(-slope0 / (slope1 - slope0), 0.0, 1.0);
  return from_point(a + t * d, box);
}

BoxDistance triangle_to_box(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                            const Eigen::Vector3d& c, const Eigen::AlignedBox3d& box) {
  const std::array<Eigen::Vector3d, 3> corner = {a, b, c};
  BoxDistance best;
  double longest_sq = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const Eigen::Vector3d &from = corner[k], &to = corner[(k + 1) % 3];
    const BoxDistance edge = segment_to_box(from, to, box);
    if (edge.distance < best.distance) best = edge;
    longest_sq = std::max(longest_sq, (to - from).squaredNorm());
  }
  if (best.distance == 0.0) return best;
  const Eigen::Vector3d n = (b - a).cross(c - a);
  if (!(n.norm() > kNoArea * longest_sq)) return best;
  // The box's corners farthest along the normal, to either side.
  const Eigen::Vector3d low = (n.array() > 0.0).select(box.min(), box.max());
  const Eigen::Vector3d high = (n.array() > 0.0).select(box.max(), box.min());
  const double below = n.dot(low - a), above = n.dot(high - a);
  Eigen::Vector3d on_plane, on_box;
  if (below > 0.0 || above < 0.0) {
    on_box = below > 0.0 ? low : high;
    on_plane = on_box - (below > 0.0 ? below : above) / n.squaredNorm() * n;
  } else {
    // What the plane cuts out of the box lies all in the triangle or all outside: no edge of the
    // triangle touches the box.
    on_plane = on_box = low + (below < above ? below / (below - above) : 0.0) * (high - low);
  }
  if (!projects_inside(on_plane, n, corner)) return best;
  const double distance = (on_plane - on_box).norm();
  if (distance < best.distance) best = {distance, distance, on_plane, on_box};
  return best;
}

BoxDistance sphere_to_box(const Sphere& sphere, const Eigen::Vector3d& center_O,
                          const Eigen::AlignedBox3d& box) {
  BoxDistance result = from_point(center_O, box);
  if (result.distance <= sphere.radius) {
    result.p_OS = result.p_OB;
    result.distance = result.lower_bound = 0.0;
    return result;
  }
  result.p_OS = result.p_OB + (1.0 - sphere.radius / result.distance) * (center_O - result.p_OB);
  result.distance = result.lower_bound = (result.p_OS - result.p_OB).norm();
  return result;
}

namespace {

// A point of the Minkowski difference, cylinder minus box, and the two it comes from.
struct Vertex {
  Eigen::Vector3d w, on_cylinder, on_box;
};

struct Simplex {
  std::array<Vertex, 4> vertex;
  std::array<double, 4> weight{};
  std::size_t size = 0;

  Eigen::Vector3d nearest() const {
    Eigen::Vector3d v = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < size; ++i) v += weight[i] * vertex[i].w;
    return v;
  }
};

// The point of the hull of k vertices that is nearest to the origin, if it is in the inside of that
// hull: their weights.
template <int kOthers>
bool solve(const Simplex& face, std::array<double, 4>* weight) {
  Eigen::Matrix<double, 3, kOthers> edges;
  for (int j = 0; j < kOthers; ++j) {
    edges.col(j) = face.vertex[static_cast<std::size_t>(j) + 1].w - face.vertex[0].w;
  }
  const Eigen::Matrix<double, kOthers, 1> solution =
      edges.colPivHouseholderQr().solve(-face.vertex[0].w);
  double first = 1.0;
  for (int j = 0; j < kOthers; ++j) {
    if (!(solution[j] >= 0.0)) return false;
    (*weight)[static_cast<std::size_t>(j) + 1] = solution[j];
    first -= solution[j];
  }
  (*weight)[0] = first;
  return first >= 0.0;
}

bool solve(Simplex* face) {
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

// The face of the simplex that holds its point nearest to the origin: all fifteen are tried, which
// cannot go astray as cleverer ways do when vertices nearly coincide.
Simplex nearest_face(const Simplex& simplex) {
  Simplex best;
  double best_sq = std::numeric_limits<double>::infinity();
  for (unsigned set = 1; set < 1U << simplex.size; ++set) {
    Simplex face;
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

Eigen::Vector3d farthest(const Cylinder& cylinder, const Eigen::Isometry3d& X_OE,
                         const Eigen::Vector3d& direction_O) {
  const Eigen::Vector3d d = X_OE.linear().transpose() * direction_O;
  const double radial = std::hypot(d.x(), d.y());
  Eigen::Vector3d p(0.0, 0.0, std::copysign(0.5 * cylinder.length, d.z()));
  if (radial > 0.0) p.head<2>() = cylinder.radius / radial * d.head<2>();
  return X_OE * p;
}

}  // namespace

BoxDistance cylinder_to_box(const Cylinder& cylinder, const Eigen::Isometry3d& X_OE,
                            const Eigen::AlignedBox3d& box) {
  constexpr int kMaxSteps = 100;
  constexpr double kTouch = 1e-12;     // [m]
  constexpr double kResolved = 1e-13;  // of the squared distance
  Simplex simplex;
  simplex.size = 1;
  simplex.weight[0] = 1.0;
  const Eigen::Vector3d center = X_OE.translation();
  simplex.vertex[0] = {center - clamp_to(box, center), center, clamp_to(box, center)};
  Eigen::Vector3d v = simplex.nearest();
  double lower_bound = 0.0;
  for (int step = 0; step < kMaxSteps && v.norm() > kTouch; ++step) {
    const Eigen::Vector3d on_cylinder = farthest(cylinder, X_OE, -v);
    const Eigen::Vector3d on_box = (v.array() > 0.0).select(box.max(), box.min());
    const Eigen::Vector3d w = on_cylinder - on_box;
    lower_bound = std::max(lower_bound, v.dot(w) / v.norm());
    if (v.squaredNorm() - v.dot(w) <= kResolved * v.squaredNorm()) break;
    Simplex larger = simplex;
    larger.vertex[larger.size++] = {w, on_cylinder, on_box};
    const Simplex face = nearest_face(larger);
    const Eigen::Vector3d nearer = face.nearest();
    if (!(nearer.squaredNorm() < v.squaredNorm())) break;  // rounding is all that is left
    simplex = face;
    v = nearer;
    if (simplex.size == 4) break;  // the origin is inside
  }
  BoxDistance result;
  result.p_OS.setZero();
  for (std::size_t i = 0; i < simplex.size; ++i) {
    result.p_OS += simplex.weight[i] * simplex.vertex[i].on_cylinder;
  }
  result.p_OB = clamp_to(box, result.p_OS);  // no farther than the weighted point of the box
  result.distance = (result.p_OS - result.p_OB).norm();
  if (result.distance <= kTouch || simplex.size == 4) {
    result.p_OS = result.p_OB;
    result.distance = 0.0;
  }
  result.lower_bound = std::min(lower_bound, result.distance);
  return result;
}

}  // namespace ist
