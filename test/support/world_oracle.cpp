#include "support/world_oracle.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>

#include "support/shape_oracle.h"

namespace ist::test {
namespace {

// The least value of a convex function on [0, 1], to 1e-9 of the interval.
template <typename Function>
double least_value(const Function& f) {
  const double ratio = 0.5 * (std::sqrt(5.0) - 1.0);
  double a = 0.0, b = 1.0, x = b - ratio * (b - a), y = a + ratio * (b - a), fx = f(x), fy = f(y);
  double least = std::min({f(a), f(b), fx, fy});
  while (b - a > 1e-9) {
    if (fx < fy) {
      b = y;
      y = x;
      fy = fx;
      fx = f(x = b - ratio * (b - a));
    } else {
      a = x;
      x = y;
      fx = fy;
      fy = f(y = a + ratio * (b - a));
    }
    least = std::min({least, fx, fy});
  }
  return least;
}

}  // namespace

OracleElement::OracleElement(const GeometryElement& element)
    : element_(element), triangles_(triangles_of({element})), groups_(triangles_) {
  Eigen::AlignedBox3d box;
  for (const auto& t : triangles_) {
    for (const auto& p : t.p) box.extend(p);
  }
  if (const auto* sphere = std::get_if<Sphere>(&element.shape)) {
    center_ = element.X_LE.translation();
    radius_ = sphere->radius;
  } else if (const auto* cylinder = std::get_if<Cylinder>(&element.shape)) {
    center_ = element.X_LE.translation();
    radius_ = std::hypot(cylinder->radius, 0.5 * cylinder->length);
  } else {
    center_ = box.center();
    radius_ = 0.5 * box.sizes().norm();
  }
}

double OracleElement::distance(const OracleElement& other, const Eigen::Isometry3d& X) const {
  if (!triangles_.empty() && !other.triangles_.empty()) return groups_.distance(other.groups_, X);
  if (triangles_.empty()) {
    if (!other.triangles_.empty()) return other.to_round(*this, X.inverse());
    return round_to_round(other, X);
  }
  return to_round(other, X);
}

double OracleElement::signed_distance(const Eigen::Vector3d& p_L) const {
  const Eigen::Vector3d p = element_.X_LE.inverse() * p_L;
  return std::visit([&](const auto& s) { return oracle_signed_distance(s, p); }, element_.shape);
}

double OracleElement::to_round(const OracleElement& round, const Eigen::Isometry3d& X) const {
  const Eigen::Isometry3d X_inv = X.inverse();
  std::vector<std::pair<double, std::size_t>> order;
  const Eigen::Vector3d center = X * round.center_;
  for (std::size_t i = 0; i < triangles_.size(); ++i) {
    const auto& p = triangles_[i].p;
    order.emplace_back(oracle_triangle(center, p[0], p[1], p[2]) - round.radius_, i);
  }
  if (std::holds_alternative<Sphere>(round.element_.shape)) {
    return std::min_element(order.begin(), order.end())->first;
  }
  std::sort(order.begin(), order.end());
  double best = std::numeric_limits<double>::infinity();
  for (const auto& [bound, i] : order) {
    if (bound >= best) break;
    const auto& p = triangles_[i].p;
    best =
        std::min(best, least_value([&](double s) {
                   const Eigen::Vector3d a = p[0] + s * (p[1] - p[0]), b = p[0] + s * (p[2] - p[0]);
                   return least_value(
                       [&](double t) { return round.signed_distance(X_inv * (a + t * (b - a))); });
                 }));
  }
  return best;
}

Eigen::Vector3d OracleElement::nearest(const Eigen::Vector3d& p_L) const {
  const Eigen::Vector3d p = element_.X_LE.inverse() * p_L;
  if (const auto* sphere = std::get_if<Sphere>(&element_.shape)) {
    return element_.X_LE * (p.norm() > sphere->radius ? p * (sphere->radius / p.norm()) : p);
  }
  const auto& cylinder = std::get<Cylinder>(element_.shape);
  Eigen::Vector3d q = p;
  const double across = p.head<2>().norm();
  if (across > cylinder.radius) q.head<2>() *= cylinder.radius / across;
  q.z() = std::clamp(p.z(), -0.5 * cylinder.length, 0.5 * cylinder.length);
  return element_.X_LE * q;
}

double OracleElement::round_to_round(const OracleElement& other, const Eigen::Isometry3d& X) const {
  const Eigen::Isometry3d X_inv = X.inverse();
  Eigen::Vector3d p = center_, q = X * other.center_;
  double last = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 100000; ++i) {
    q = X * other.nearest(X_inv * p);
    p = nearest(q);
    const double distance = (p - q).norm();
    if (last - distance < 1e-16) break;
    last = distance;
  }
  return (p - q).norm() < 1e-9 ? 0.0 : (p - q).norm();
}

OracleSolid::OracleSolid(const LinkGeometry& geometry) : geometry_(geometry) {
  for (const GeometryElement& element : geometry) {
    elements_.emplace_back(element);
    const auto triangles = triangles_of({element});
    for (const auto& t : triangles) {
      for (const auto& p : t.p) points_.push_back(p);
    }
    if (triangles.empty()) points_.push_back(element.X_LE.translation());
  }
}

double OracleSolid::distance(const OracleSolid& other, const Eigen::Isometry3d& X,
                             double enough) const {
  double best = enough;
  for (const OracleElement& a : elements_) {
    for (const OracleElement& b : other.elements_) {
      const double bound = (a.center() - X * b.center()).norm() - a.radius() - b.radius();
      if (bound < best) best = std::min(best, a.distance(b, X));
    }
  }
  if (best > 0.0 && (holds(other, X) || other.holds(*this, X.inverse()))) return 0.0;
  return best;
}

bool OracleSolid::holds(const OracleSolid& other, const Eigen::Isometry3d& X) const {
  return std::any_of(other.points_.begin(), other.points_.end(), [&](const Eigen::Vector3d& p) {
    const Eigen::Vector3d q = X * p;
    const bool may_be = std::any_of(elements_.begin(), elements_.end(), [&](const auto& e) {
      return (q - e.center()).norm() <= e.radius();
    });
    return may_be && oracle_signed_distance(geometry_, q) < -1e-9;
  });
}

}  // namespace ist::test
