// Distances of convex parts: triangles, spheres and cylinders.

#include <algorithm>
#include <array>
#include <cmath>

#include "internal/geometry/closest_point_on_triangle.h"
#include "internal/geometry/convex_part.h"

namespace ist {
namespace {

using Kind = ConvexPart::Kind;

constexpr double kTouch = 1e-13;  // [m] points nearer than this have no direction

// The unit vector of a cylinder's axis, and half its length.
struct Axis {
  explicit Axis(const ConvexPart& cylinder)
      : half(cylinder.b.norm()),
        unit(half > 0.0 ? Eigen::Vector3d(cylinder.b / half) : Eigen::Vector3d::UnitZ()) {}
  double half;
  Eigen::Vector3d unit;
};

// The point of a solid cylinder that is closest to x.
Eigen::Vector3d closest_in_cylinder(const ConvexPart& cylinder, const Eigen::Vector3d& x) {
  const Axis axis(cylinder);
  const double along = axis.unit.dot(x - cylinder.a);
  const Eigen::Vector3d radial = x - cylinder.a - along * axis.unit;
  const double distance = radial.norm();
  const double share = distance > cylinder.radius ? cylinder.radius / distance : 1.0;
  return cylinder.a + std::clamp(along, -axis.half, axis.half) * axis.unit + share * radial;
}

// The closest point of a part to x; a sphere counts as its centre.
Eigen::Vector3d closest_point(const ConvexPart& part, const Eigen::Vector3d& x) {
  if (part.kind == Kind::kTriangle) return closest_point_on_triangle(x, part.a, part.b, part.c);
  return part.kind == Kind::kSphere ? part.a : closest_in_cylinder(part, x);
}

// The point of a part that is farthest along a direction; a sphere counts as its centre.
Eigen::Vector3d support_point(const ConvexPart& part, const Eigen::Vector3d& direction) {
  if (part.kind == Kind::kSphere) return part.a;
  if (part.kind == Kind::kTriangle) {
    const double a = direction.dot(part.a), b = direction.dot(part.b), c = direction.dot(part.c);
    return a >= b && a >= c ? part.a : (b >= c ? part.b : part.c);
  }
  const Axis axis(part);
  const double along = direction.dot(axis.unit);
  const Eigen::Vector3d radial = direction - along * axis.unit;
  const double length = radial.norm();
  Eigen::Vector3d point = part.a + std::copysign(axis.half, along) * axis.unit;
  if (length > 0.0) {
    // Along the axis the difference is all rounding, and no longer perpendicular.
    const Eigen::Vector3d outward = radial / length;
    point += part.radius * (outward - outward.dot(axis.unit) * axis.unit).normalized();
  }
  return point;
}

// Corner of a simplex in the Minkowski difference P - Q, and the points that it comes from.
struct Corner {
  Eigen::Vector3d w, on_p, on_q;
};

// Up to four corners, and their weights at the simplex' point that is nearest to the origin.
struct Simplex {
  std::array<Corner, 4> corner;
  std::array<double, 4> weight{1.0, 0.0, 0.0, 0.0};
  std::size_t size = 0;

  Eigen::Vector3d sum(Eigen::Vector3d Corner::*member) const {
    Eigen::Vector3d v = Eigen::Vector3d::Zero();
    for (std::size_t i = 0; i < size; ++i) v += weight[i] * (corner[i].*member);
    return v;
  }
};

Simplex on_edge(const Corner& a, const Corner& b) {
  Simplex result;
  result.corner[0] = a;
  result.corner[1] = b;
  result.size = 2;
  const Eigen::Vector3d ab = b.w - a.w;
  const double length_sq = ab.squaredNorm();
  const double t = length_sq > 0.0 ? std::clamp(-a.w.dot(ab) / length_sq, 0.0, 1.0) : 0.0;
  result.weight = {1.0 - t, t, 0.0, 0.0};
  return result;
}

void keep_nearer(const Simplex& candidate, Simplex* best, double* best_sq) {
  const double distance_sq = candidate.sum(&Corner::w).squaredNorm();
  if (!(distance_sq < *best_sq)) return;
  *best = candidate;
  *best_sq = distance_sq;
}

// The edges are tried even where the projection falls inside: that costs little, and is right for
// slivers too.
Simplex on_triangle(const Corner& a, const Corner& b, const Corner& c) {
  Simplex best;
  double best_sq = std::numeric_limits<double>::infinity();
  keep_nearer(on_edge(a, b), &best, &best_sq);
  keep_nearer(on_edge(b, c), &best, &best_sq);
  keep_nearer(on_edge(c, a), &best, &best_sq);
  const Eigen::Vector3d n = (b.w - a.w).cross(c.w - a.w);
  const double n_sq = n.squaredNorm();
  const double of_a = n.dot(b.w.cross(c.w)), of_b = n.dot(c.w.cross(a.w)),
               of_c = n.dot(a.w.cross(b.w));
  if (!(n_sq > 0.0 && of_a >= 0.0 && of_b >= 0.0 && of_c >= 0.0)) return best;
  Simplex inside;
  inside.corner = {a, b, c, c};
  inside.size = 3;
  const double total = of_a + of_b + of_c;
  inside.weight = {of_a / total, of_b / total, of_c / total, 0.0};
  keep_nearer(inside, &best, &best_sq);
  return best;
}

bool holds_origin(const std::array<Corner, 4>& c) {
  const auto same_side = [&](std::size_t i, std::size_t j, std::size_t k, std::size_t apex) {
    const Eigen::Vector3d n = (c[j].w - c[i].w).cross(c[k].w - c[i].w);
    const double of_apex = n.dot(c[apex].w - c[i].w), of_origin = -n.dot(c[i].w);
    return of_apex != 0.0 && of_apex * of_origin >= 0.0;
  };
  return same_side(0, 1, 2, 3) && same_side(0, 1, 3, 2) && same_side(0, 2, 3, 1) &&
         same_side(1, 2, 3, 0);
}

// The weights of four corners about the origin, as their sub-volumes.
void set_weights_of_origin(Simplex* s) {
  const auto volume = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                         const Eigen::Vector3d& c) { return std::abs(a.dot(b.cross(c))); };
  const auto& c = s->corner;
  s->weight = {volume(c[1].w, c[2].w, c[3].w), volume(c[0].w, c[2].w, c[3].w),
               volume(c[0].w, c[1].w, c[3].w), volume(c[0].w, c[1].w, c[2].w)};
  const double total = s->weight[0] + s->weight[1] + s->weight[2] + s->weight[3];
  for (double& weight : s->weight) weight = total > 0.0 ? weight / total : 0.25;
}

// Whether four corners hold the origin, with their weights there. Flat ones may seem to, by
// rounding: then the weights do not give the origin.
bool is_about_origin(Simplex* s) {
  constexpr double kRounding = 1e-11;
  if (!holds_origin(s->corner)) return false;
  set_weights_of_origin(s);
  double size = 0.0;
  for (const Corner& corner : s->corner) size = std::max(size, corner.w.norm());
  return s->sum(&Corner::w).norm() <= kRounding * size;
}

// The face of the simplex that holds its point nearest to the origin; all four corners if that is
// the origin itself.
Simplex nearest_face(Simplex s) {
  const auto& c = s.corner;
  if (s.size == 1) return s;
  if (s.size == 2) return on_edge(c[0], c[1]);
  if (s.size == 3) return on_triangle(c[0], c[1], c[2]);
  if (is_about_origin(&s)) return s;
  Simplex best;
  double best_sq = std::numeric_limits<double>::infinity();
  keep_nearer(on_triangle(c[0], c[1], c[3]), &best, &best_sq);
  keep_nearer(on_triangle(c[0], c[2], c[3]), &best, &best_sq);
  keep_nearer(on_triangle(c[1], c[2], c[3]), &best, &best_sq);
  keep_nearer(on_triangle(c[0], c[1], c[2]), &best, &best_sq);
  return best;
}

void drop_corners_without_weight(Simplex* s) {
  std::size_t kept = 0;
  for (std::size_t i = 0; i < s->size; ++i) {
    if (!(s->weight[i] > 0.0)) continue;
    s->corner[kept] = s->corner[i];
    s->weight[kept++] = s->weight[i];
  }
  s->size = kept;
}

ConvexDistance gjk(const ConvexPart& p, const ConvexPart& q, double enough) {
  constexpr int kMaxSteps = 100;
  constexpr double kResolved = 1e-12;  // of the distance
  const auto corner = [&](const Eigen::Vector3d& direction) {
    const Eigen::Vector3d on_p = support_point(p, direction), on_q = support_point(q, -direction);
    return Corner{on_p - on_q, on_p, on_q};
  };
  Simplex simplex;
  simplex.corner[0] = corner(q.a - p.a);
  simplex.size = 1;
  Eigen::Vector3d v = simplex.corner[0].w;
  ConvexDistance result;
  double lower_bound = 0.0;
  for (int step = 0; step < kMaxSteps && v.norm() > kTouch; ++step) {
    const double distance = v.norm();
    const Corner next = corner(-v);
    lower_bound = std::max(lower_bound, v.dot(next.w) / distance);
    if (lower_bound >= enough || lower_bound >= (1.0 - kResolved) * distance) break;
    Simplex larger = simplex;
    larger.corner[larger.size++] = next;
    Simplex face = nearest_face(larger);
    if (face.size == 4) {  // the parts intersect
      simplex = face;
      break;
    }
    drop_corners_without_weight(&face);
    const Eigen::Vector3d nearer = face.sum(&Corner::w);
    if (!(nearer.squaredNorm() < v.squaredNorm())) break;  // by rounding alone
    simplex = face;
    v = nearer;
  }
  result.on_p = simplex.sum(&Corner::on_p);
  result.on_q = simplex.sum(&Corner::on_q);
  result.distance = (result.on_p - result.on_q).norm();
  if (simplex.size == 4 || result.distance <= kTouch) {
    result.distance = 0.0;
    result.on_p = result.on_q = 0.5 * (result.on_p + result.on_q);
  }
  result.lower_bound = std::clamp(lower_bound, 0.0, result.distance);
  return result;
}

// The distance of a sphere's centre to another part, less the radius; both have one if both are
// spheres.
ConvexDistance from_sphere(const ConvexPart& sphere, const ConvexPart& other) {
  ConvexDistance result;
  const Eigen::Vector3d at = closest_point(other, sphere.a), off = sphere.a - at;
  const double distance = off.norm(), radius = other.kind == Kind::kSphere ? other.radius : 0.0;
  const Eigen::Vector3d n =
      distance > 0.0 ? Eigen::Vector3d(off / distance) : Eigen::Vector3d::UnitZ();
  result.on_p = sphere.a - sphere.radius * n;
  result.on_q = at + radius * n;
  result.distance = distance - sphere.radius - radius;
  result.lower_bound = std::max(result.distance, 0.0);
  if (result.distance <= 0.0) {  // a point of both, on the line of the centres
    const double low = std::max(distance - sphere.radius, -radius);
    const double high = std::min(distance + sphere.radius, radius);
    result.on_p = result.on_q = at + 0.5 * (low + high) * n;
  }
  return result;
}

ConvexDistance swapped(ConvexDistance d) {
  std::swap(d.on_p, d.on_q);
  return d;
}

}  // namespace

ConvexPart posed(const ConvexPart& part, const Eigen::Isometry3d& X) {
  ConvexPart result = part;
  result.a = X * part.a;
  if (part.kind == Kind::kCylinder) {
    result.b = X.linear() * part.b;
  } else if (part.kind == Kind::kTriangle) {
    result.b = X * part.b;
    result.c = X * part.c;
  }
  return result;
}

double support(const ConvexPart& part, const Eigen::Vector3d& n) {
  return n.dot(support_point(part, n)) + (part.kind == Kind::kSphere ? part.radius : 0.0);
}

ConvexDistance convex_distance(const ConvexPart& p, const ConvexPart& q, double enough) {
  if (p.kind == Kind::kTriangle && q.kind == Kind::kTriangle) return triangle_distance(p, q);
  if (p.kind == Kind::kSphere) return from_sphere(p, q);
  if (q.kind == Kind::kSphere) return swapped(from_sphere(q, p));
  return gjk(p, q, enough);
}

// By the support function: whatever rounding does to the closest point, a slab separates.
double box_bound(const ConvexPart& part, const Eigen::Vector3d& center, const Eigen::Matrix3d& axes,
                 const Eigen::Vector3d& half) {
  const Eigen::Vector3d across = center - closest_point(part, center);
  const double distance = across.norm();
  if (!(distance > kTouch)) return 0.0;
  const Eigen::Vector3d n = across / distance;
  const double extent = (axes.transpose() * n).cwiseAbs().dot(half);
  return std::max(n.dot(center) - extent - support(part, n), 0.0);
}

}  // namespace ist
