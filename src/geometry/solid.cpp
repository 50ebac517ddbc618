#include "ist_proximity/geometry/solid.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/tessellation.h"

namespace ist {
namespace {

// Below this distance [m] the line from surface to point has no direction worth having.
constexpr double kTouch = 1e-12;

constexpr double kAnywhere = std::numeric_limits<double>::infinity();

SignedDistance to_box(const Box& box, const Eigen::Vector3d& p) {
  const Eigen::Vector3d half = 0.5 * box.size;
  const Eigen::Vector3d outside = p.cwiseAbs() - half;
  Eigen::Index axis;
  const double largest = outside.maxCoeff(&axis);
  SignedDistance result;
  result.witness = p.cwiseMax(-half).cwiseMin(half);
  const Eigen::Vector3d away = p - result.witness;
  result.distance = away.norm();
  if (largest > 0.0 && result.distance > kTouch) {
    result.normal = away / result.distance;
    return result;
  }
  const double side = std::copysign(1.0, p[axis]);
  result.witness[axis] = side * half[axis];
  result.distance = largest;
  result.normal = side * Eigen::Vector3d::Unit(axis);
  return result;
}

SignedDistance to_cylinder(const Cylinder& cylinder, const Eigen::Vector3d& p) {
  const double half = 0.5 * cylinder.length;
  const double radial = std::hypot(p.x(), p.y());
  const Eigen::Vector3d outward = radial > kTouch
                                      ? Eigen::Vector3d(p.x() / radial, p.y() / radial, 0)
                                      : Eigen::Vector3d::UnitX();
  const double side = std::copysign(1.0, p.z());
  const double over_wall = radial - cylinder.radius, over_cap = std::abs(p.z()) - half;
  SignedDistance result;
  if (over_wall <= 0.0 && over_cap <= 0.0) {
    if (over_wall > over_cap) {
      result.witness = cylinder.radius * outward + p.z() * Eigen::Vector3d::UnitZ();
      result.normal = outward;
      result.distance = over_wall;
    } else {
      result.witness = {p.x(), p.y(), side * half};
      result.normal = side * Eigen::Vector3d::UnitZ();
      result.distance = over_cap;
    }
    return result;
  }
  result.witness = std::min(radial, cylinder.radius) * outward;
  if (radial <= kTouch) result.witness.setZero();
  result.witness.z() = std::clamp(p.z(), -half, half);
  const Eigen::Vector3d away = p - result.witness;
  result.distance = away.norm();
  if (result.distance > kTouch) {
    result.normal = away / result.distance;
  } else {
    result.normal =
        over_wall > over_cap ? outward : Eigen::Vector3d(side * Eigen::Vector3d::UnitZ());
  }
  return result;
}

SignedDistance to_sphere(const Sphere& sphere, const Eigen::Vector3d& p) {
  const double norm = p.norm();
  SignedDistance result;
  result.normal = norm > kTouch ? Eigen::Vector3d(p / norm) : Eigen::Vector3d::UnitZ();
  result.witness = sphere.radius * result.normal;
  result.distance = norm - sphere.radius;
  return result;
}

SignedDistance to_primitive(const Shape& shape, const Eigen::Vector3d& p) {
  if (const auto* box = std::get_if<Box>(&shape)) return to_box(*box, p);
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) return to_cylinder(*cylinder, p);
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return to_sphere(*sphere, p);
  return {};
}

double primitive_support(const Shape& shape, const Eigen::Vector3d& n) {
  if (const auto* box = std::get_if<Box>(&shape)) return 0.5 * box->size.dot(n.cwiseAbs());
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return cylinder->radius * std::hypot(n.x(), n.y()) + 0.5 * cylinder->length * std::abs(n.z());
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) return sphere->radius * n.norm();
  return -std::numeric_limits<double>::infinity();
}

std::vector<Eigen::Vector3d> face_normals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals;
  normals.reserve(mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Eigen::Vector3d n =
        (mesh.corner(t, 1) - mesh.corner(t, 0)).cross(mesh.corner(t, 2) - mesh.corner(t, 0));
    const double norm = n.norm();
    normals.push_back(norm > 0.0 ? Eigen::Vector3d(n / norm) : Eigen::Vector3d::Zero());
  }
  return normals;
}

// At the surface itself the face's normal speaks; where the mesh has it inside out, reversed.
Eigen::Vector3d normal_at_touch(const TriangleBvh& bvh, const Eigen::Vector3d& face_normal,
                                const Eigen::Vector3d& witness) {
  if (face_normal.isZero()) return Eigen::Vector3d::UnitZ();
  const double step = 1e-6 * (1.0 + bvh.bounds().sizes().norm());
  const double front = bvh.winding_number(witness + step * face_normal);
  const double back = bvh.winding_number(witness - step * face_normal);
  return front <= back ? face_normal : Eigen::Vector3d(-face_normal);
}

// `closest` gives the distance a sign and a way.
SignedDistance with_sign(const TriangleBvh& bvh, const std::vector<Eigen::Vector3d>& normals,
                         const Eigen::Vector3d& p, const ClosestPoint& closest, bool inside) {
  SignedDistance result;
  if (!std::isfinite(closest.distance_sq)) return result;
  const double distance = std::sqrt(closest.distance_sq);
  result.witness = closest.point;
  result.distance = inside ? -distance : distance;
  if (distance > kTouch) {
    result.normal = (inside ? closest.point - p : p - closest.point) / distance;
  } else {
    result.normal = normal_at_touch(bvh, normals[closest.triangle], closest.point);
  }
  return result;
}

SignedDistance to_mesh(const TriangleBvh& bvh, const std::vector<Eigen::Vector3d>& normals,
                       const Eigen::Vector3d& p, double max_distance, bool inside) {
  return with_sign(bvh, normals, p, bvh.closest(p, max_distance * max_distance), inside);
}

// Where it is told that a surface is within some distance, that is not to be missed by a rounding.
double a_little_more(double distance) { return (1.0 + 1e-9) * distance + kTouch; }

}  // namespace

Solid::Solid(const LinkGeometry& geometry) {
  elements_.reserve(geometry.size());
  for (const GeometryElement& source : geometry) {
    Element element;
    element.X_LE = source.X_LE;
    element.X_EL = source.X_LE.inverse();
    element.is_closed = true;
    if (const auto* mesh = std::get_if<TriangleMesh>(&source.shape)) {
      element.primitive = TriangleMesh{};
      element.bvh = TriangleBvh(*mesh);
      element.normals = face_normals(*mesh);
      element.is_closed = is_closed_mesh(*mesh);
    } else {
      element.primitive = source.shape;
      if (const auto* box = std::get_if<Box>(&source.shape)) {
        element.sides = TriangleBvh(tessellate(*box).mesh);
      }
    }
    elements_.push_back(std::move(element));
  }
}

SignedDistance Solid::signed_distance(const Eigen::Vector3d& p_L) const {
  SignedDistance best;
  for (const Element& element : elements_) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    SignedDistance candidate;
    if (element.bvh.size() > 0) {
      const bool inside = element.bvh.bounds().contains(p_E) && element.bvh.is_inside(p_E);
      const double limit = inside || best.distance < 0.0
                               ? (inside ? std::numeric_limits<double>::infinity() : 0.0)
                               : best.distance;
      candidate = to_mesh(element.bvh, element.normals, p_E, limit, inside);
    } else {
      candidate = to_primitive(element.primitive, p_E);
    }
    if (candidate.distance < best.distance) {
      best.distance = candidate.distance;
      best.witness = element.X_LE * candidate.witness;
      best.normal = element.X_LE.linear() * candidate.normal;
    }
  }
  return best;
}

SignedDistance Solid::distance_outside(const Eigen::Vector3d& p_L, double max_distance,
                                       const Eigen::Vector3d& toward_L, double slack,
                                       double* lower_bound) const {
  SignedDistance best;
  if (lower_bound != nullptr) *lower_bound = std::max(max_distance, 0.0);
  if (!(max_distance > 0.0)) return best;
  double bound = max_distance;
  for (const Element& element : elements_) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    SignedDistance candidate;
    double floor;
    if (element.bvh.size() > 0) {
      const ClosestPoint closest =
          element.bvh.closest(p_E, bound * bound, element.X_EL.linear() * toward_L, 0.0, slack);
      candidate = with_sign(element.bvh, element.normals, p_E, closest, false);
      floor = closest.lower_bound;
    } else {
      candidate = to_primitive(element.primitive, p_E);
      floor = candidate.distance;
    }
    if (lower_bound != nullptr) *lower_bound = std::min(*lower_bound, floor);
    if (candidate.distance < bound) {
      bound = candidate.distance;
      best.distance = candidate.distance;
      best.witness = element.X_LE * candidate.witness;
      best.normal = element.X_LE.linear() * candidate.normal;
    }
  }
  return best;
}

// Inside comes last: it is asked of few.
PointDepth Solid::depth(const Eigen::Vector3d& p_L, double enough, const NearSurface& known) const {
  const double enough_sq = enough > 0.0 ? enough * enough : -1.0;
  const bool is_one = elements_.size() == 1;
  const double within = is_one ? a_little_more(known.within) : kAnywhere;
  PointDepth result;
  bool is_known = true;
  for (const Element& element : elements_) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    SignedDistance candidate;
    if (element.bvh.size() == 0) {
      candidate = to_primitive(element.primitive, p_E);
      result.floor = std::min(result.floor, candidate.distance);
    } else {
      const ClosestPoint closest =
          element.bvh.closest(p_E, within * within, Eigen::Vector3d::Zero(), enough_sq);
      const double distance = std::sqrt(closest.distance_sq);
      if (closest.distance_sq <= enough_sq) {
        is_known = false;
        result.floor = std::min(result.floor, -distance);
        continue;
      }
      const bool inside = is_one && known.side != NearSurface::Side::kUnknown
                              ? known.side == NearSurface::Side::kInside
                              : element.bvh.bounds().contains(p_E) && element.bvh.is_inside(p_E);
      candidate = with_sign(element.bvh, element.normals, p_E, closest, inside);
      result.floor = std::min(result.floor, element.is_closed && !inside ? distance : -distance);
    }
    if (candidate.distance < result.exact.distance) {
      result.exact.distance = candidate.distance;
      result.exact.witness = element.X_LE * candidate.witness;
      result.exact.normal = element.X_LE.linear() * candidate.normal;
    }
  }
  // What was not sought is not as deep as `enough`.
  if (!is_known && result.exact.distance >= -enough) result.exact = SignedDistance();
  return result;
}

double Solid::support(const Eigen::Vector3d& n_L, double slack, double reached) const {
  double farthest = reached;
  for (const Element& element : elements_) {
    const Eigen::Vector3d n_E = element.X_EL.linear() * n_L;
    const double offset = n_L.dot(element.X_LE.translation());
    const double reach = element.bvh.size() > 0 ? element.bvh.support(n_E, slack, farthest - offset)
                                                : primitive_support(element.primitive, n_E);
    farthest = std::max(farthest, reach + offset);
  }
  return farthest;
}

BoxDistance Solid::distance_to_box(const Eigen::AlignedBox3d& box_O, const Eigen::Isometry3d& X_OL,
                                   double max_distance) const {
  BoxDistance best;
  double limit = max_distance, lower_bound = max_distance;
  for (const Element& element : elements_) {
    const Eigen::Isometry3d X_OE = X_OL * element.X_LE;
    BoxDistance candidate;
    if (element.bvh.size() > 0) {
      candidate = element.bvh.closest_to_box(box_O, X_OE, limit);
    } else if (const auto* sphere = std::get_if<Sphere>(&element.primitive)) {
      candidate = sphere_to_box(*sphere, X_OE.translation(), box_O);
    } else if (const auto* cylinder = std::get_if<Cylinder>(&element.primitive)) {
      candidate = cylinder_to_box(*cylinder, X_OE, box_O);
    } else {
      candidate = element.sides.closest_to_box(box_O, X_OE, limit);
    }
    lower_bound = std::min(lower_bound, candidate.lower_bound);
    if (candidate.distance >= limit) continue;
    best = candidate;
    limit = candidate.distance;
  }
  best.lower_bound = lower_bound;
  return best;
}

bool Solid::is_closed() const {
  return std::all_of(elements_.begin(), elements_.end(),
                     [](const Element& element) { return element.is_closed; });
}

double Solid::distance_floor(const Eigen::Vector3d& p_L, const SignedDistance& measured) const {
  double floor = measured.distance;
  for (const Element& element : elements_) {
    if (element.is_closed || element.bvh.size() == 0) continue;
    const double unsigned_distance =
        elements_.size() == 1 ? std::abs(measured.distance)
                              : std::sqrt(element.bvh.closest(element.X_EL * p_L).distance_sq);
    floor = std::min(floor, -unsigned_distance);
  }
  return floor;
}

bool Solid::is_inside(const Eigen::Vector3d& p_L) const {
  return std::any_of(elements_.begin(), elements_.end(), [&](const Element& element) {
    const Eigen::Vector3d p_E = element.X_EL * p_L;
    if (element.bvh.size() == 0) return to_primitive(element.primitive, p_E).distance < 0.0;
    return element.bvh.bounds().contains(p_E) && element.bvh.is_inside(p_E);
  });
}

std::size_t Solid::triangle_count() const {
  std::size_t count = 0;
  for (const Element& element : elements_) count += element.bvh.size();
  return count;
}

}  // namespace ist
