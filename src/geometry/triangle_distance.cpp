// The distance of two triangles.

#include <algorithm>
#include <array>
#include <cmath>

#include "internal/geometry/closest_point_on_triangle.h"
#include "internal/geometry/convex_part.h"

namespace ist {
namespace {

using CornerPointers = std::array<const Eigen::Vector3d*, 3>;

CornerPointers corners_of(const ConvexPart& part) { return {&part.a, &part.b, &part.c}; }

// The lower bound is as good as the distance when it is less by no more than this share.
constexpr double kResolved = 1e-12;

class TrianglePair {
 public:
  TrianglePair(const ConvexPart& p, const ConvexPart& q)
      : p_(p), q_(q), corners_p_(corners_of(p)), corners_q_(corners_of(q)) {}

  ConvexDistance run() {
    for (std::size_t i = 0; i < 3; ++i) {
      attempt(*corners_p_[i], closest_point_on_triangle(*corners_p_[i], q_.a, q_.b, q_.c));
      attempt(closest_point_on_triangle(*corners_q_[i], p_.a, p_.b, p_.c), *corners_q_[i]);
    }
    if (is_proven()) return best_;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        attempt_edges(*corners_p_[i], *corners_p_[(i + 1) % 3], *corners_q_[k],
                      *corners_q_[(k + 1) % 3]);
      }
    }
    if (is_proven()) return best_;
    prove_by_axes();
    if (best_.lower_bound <= 0.0) search_piercing();
    return best_;
  }

 private:
  void attempt(const Eigen::Vector3d& on_p, const Eigen::Vector3d& on_q) {
    const double distance_sq = (on_p - on_q).squaredNorm();
    if (!(distance_sq < best_sq_)) return;
    best_sq_ = distance_sq;
    best_.on_p = on_p;
    best_.on_q = on_q;
  }

  // The closest points of two edges (Ericson, Real-Time Collision Detection, 5.1.9). Where the
  // edges are parallel, the closest points found at their ends are as close.
  void attempt_edges(const Eigen::Vector3d& p0, const Eigen::Vector3d& p1,
                     const Eigen::Vector3d& q0, const Eigen::Vector3d& q1) {
    const Eigen::Vector3d u = p1 - p0, v = q1 - q0, w = p0 - q0;
    const double uu = u.squaredNorm(), uv = u.dot(v), vv = v.squaredNorm();
    const double uw = u.dot(w), vw = v.dot(w), determinant = uu * vv - uv * uv;
    if (!(uu > 0.0) || !(vv > 0.0)) return;
    double s = determinant > 0.0 ? std::clamp((uv * vw - vv * uw) / determinant, 0.0, 1.0) : 0.0;
    const double t = std::clamp((uv * s + vw) / vv, 0.0, 1.0);
    s = std::clamp((uv * t - uw) / uu, 0.0, 1.0);
    attempt(p0 + s * u, q0 + t * v);
  }

  // The slab perpendicular to the line through the points found.
  bool is_proven() {
    best_.distance = std::sqrt(best_sq_);
    best_.lower_bound = 0.0;
    if (!(best_.distance > 0.0)) return true;
    best_.lower_bound =
        std::clamp(slab((best_.on_p - best_.on_q) / best_.distance), 0.0, best_.distance);
    return best_.lower_bound >= (1.0 - kResolved) * best_.distance;
  }

  // [m] The width of the slab between the triangles that is perpendicular to n, where P is on the
  // side to which n points; negative where there is none. @param n  unit
  double slab(const Eigen::Vector3d& n) const {
    const auto along = [&](const CornerPointers& corners, std::size_t i) {
      return n.dot(*corners[i] - best_.on_q);
    };
    const double above =
        std::min({along(corners_p_, 0), along(corners_p_, 1), along(corners_p_, 2)});
    const double below =
        std::max({along(corners_q_, 0), along(corners_q_, 1), along(corners_q_, 2)});
    return above - below;
  }

  // Some nanometres from touch, rounding turns the line through the closest points. The normals of
  // the triangles and the common perpendiculars of their edges (the axes of the separating axis
  // test) do not depend on these.
  void prove_by_axes() {
    const auto edge = [](const CornerPointers& corners, std::size_t i) {
      return Eigen::Vector3d(*corners[(i + 1) % 3] - *corners[i]);
    };
    prove_by_axis(edge(corners_p_, 0), edge(corners_p_, 1));
    prove_by_axis(edge(corners_q_, 0), edge(corners_q_, 1));
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) prove_by_axis(edge(corners_p_, i), edge(corners_q_, k));
    }
  }

  // Tries the slab along two edges.
  void prove_by_axis(const Eigen::Vector3d& u, const Eigen::Vector3d& v) {
    const Eigen::Vector3d n = u.cross(v);
    const double length = n.norm();
    if (!(length > 0.0)) return;
    const double width = std::max(slab(n / length), slab(-n / length));
    best_.lower_bound = std::min(std::max(best_.lower_bound, width), best_.distance);
  }

  void search_piercing() {
    for (std::size_t i = 0; i < 3; ++i) {
      const bool found = pierce(*corners_p_[i], *corners_p_[(i + 1) % 3], corners_q_) ||
                         pierce(*corners_q_[i], *corners_q_[(i + 1) % 3], corners_p_);
      if (found) return;
    }
  }

  // Whether the edge from s to t passes through a triangle: its ends are on different sides of the
  // plane, and the line passes all edges on the same side. Where rounding spoils a sign, one of the
  // distances that are measured already is as small as rounding.
  bool pierce(const Eigen::Vector3d& s, const Eigen::Vector3d& t, const CornerPointers& triangle) {
    const Eigen::Vector3d a = *triangle[0] - s, b = *triangle[1] - s, c = *triangle[2] - s;
    const Eigen::Vector3d st = t - s, n = (b - a).cross(c - a);
    const double from_s = -n.dot(a), from_t = n.dot(st - a);
    if (!((from_s <= 0.0 && from_t >= 0.0) || (from_s >= 0.0 && from_t <= 0.0))) return false;
    if (from_s == from_t) return false;  // in the plane: edges meet edges, or nothing does
    const double ab = st.dot(a.cross(b)), bc = st.dot(b.cross(c)), ca = st.dot(c.cross(a));
    const bool inside =
        (ab >= 0.0 && bc >= 0.0 && ca >= 0.0) || (ab <= 0.0 && bc <= 0.0 && ca <= 0.0);
    if (!inside) return false;
    best_.on_p = best_.on_q = s + from_s / (from_s - from_t) * st;
    best_.distance = best_.lower_bound = 0.0;
    return true;
  }

  const ConvexPart &p_, &q_;
  const CornerPointers corners_p_, corners_q_;
  double best_sq_ = std::numeric_limits<double>::infinity();
  ConvexDistance best_;
};

}  // namespace

ConvexDistance triangle_distance(const ConvexPart& p, const ConvexPart& q) {
  return TrianglePair(p, q).run();
}

}  // namespace ist
