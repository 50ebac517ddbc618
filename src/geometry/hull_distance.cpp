// Distance of two convex hulls by GJK. It only has to find a good direction: the lower bound is the
// width of the slab across it, whatever rounding does to the search.

#include "internal/geometry/hull_distance.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr int kMaxDistanceSteps = 40;

// Weights of the point of a simplex' face that is nearest to the origin.
struct Face {
  std::array<double, 4> weight{};
  double distance_sq = kInfinity;  // [m^2]
};

void keep_nearer(const std::array<DifferenceSimplex::Corner, 4>& c,
                 const std::array<double, 4>& weight, Face* best) {
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    if (weight[i] > 0.0) v += weight[i] * c[i].w;
  }
  const double distance_sq = v.squaredNorm();
  if (distance_sq < best->distance_sq) *best = {weight, distance_sq};
}

void try_edge(const std::array<DifferenceSimplex::Corner, 4>& c, std::size_t i, std::size_t j,
              Face* best) {
  const Eigen::Vector3d along = c[j].w - c[i].w;
  const double length_sq = along.squaredNorm();
  const double t = length_sq > 0.0 ? std::clamp(-c[i].w.dot(along) / length_sq, 0.0, 1.0) : 0.0;
  std::array<double, 4> weight{};
  weight[i] = 1.0 - t;
  weight[j] = t;
  keep_nearer(c, weight, best);
}

// The interior of a triangle, or its edges where the origin is not over it.
void try_triangle(const std::array<DifferenceSimplex::Corner, 4>& c, std::size_t i, std::size_t j,
                  std::size_t k, Face* best) {
  const Eigen::Vector3d n = (c[j].w - c[i].w).cross(c[k].w - c[i].w);
  const double of_i = n.dot(c[j].w.cross(c[k].w)), of_j = n.dot(c[k].w.cross(c[i].w)),
               of_k = n.dot(c[i].w.cross(c[j].w));
  const double total = of_i + of_j + of_k;
  if (of_i >= 0.0 && of_j >= 0.0 && of_k >= 0.0 && total > 0.0) {
    std::array<double, 4> weight{};
    weight[i] = of_i / total;
    weight[j] = of_j / total;
    weight[k] = of_k / total;
    return keep_nearer(c, weight, best);
  }
  if (!(of_k > 0.0)) try_edge(c, i, j, best);
  if (!(of_i > 0.0)) try_edge(c, j, k, best);
  if (!(of_j > 0.0)) try_edge(c, k, i, best);
}

// Faces that the origin is not certain to be behind; if there is none, the tetrahedron holds it.
void try_tetrahedron(const std::array<DifferenceSimplex::Corner, 4>& c, Face* best) {
  constexpr std::size_t kFaces[4][4] = {{1, 2, 3, 0}, {0, 2, 3, 1}, {0, 1, 3, 2}, {0, 1, 2, 3}};
  std::array<double, 4> volume{};
  bool holds_origin = true;
  for (const auto& face : kFaces) {
    const Eigen::Vector3d& p = c[face[0]].w;
    const Eigen::Vector3d n = (c[face[1]].w - p).cross(c[face[2]].w - p);
    const double of_apex = n.dot(c[face[3]].w - p), of_origin = -n.dot(p);
    volume[face[3]] = std::abs(of_origin);
    if (of_apex * of_origin > 0.0) continue;
    holds_origin = false;
    try_triangle(c, face[0], face[1], face[2], best);
  }
  const double total = volume[0] + volume[1] + volume[2] + volume[3];
  if (!holds_origin || !(total > 0.0)) return;
  for (double& share : volume) share /= total;
  keep_nearer(c, volume, best);
}

}  // namespace

Eigen::Vector3d DifferenceSimplex::nearest() const {
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < size; ++i) v += weight[i] * corner[i].w;
  return v;
}

Eigen::Vector3d DifferenceSimplex::on_a() const {
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < size; ++i) v += weight[i] * corner[i].on_a;
  return v;
}

Eigen::Vector3d DifferenceSimplex::on_b() const {
  Eigen::Vector3d v = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < size; ++i) v += weight[i] * corner[i].on_b;
  return v;
}

void DifferenceSimplex::reduce() {
  Face best;
  if (size == 1) best.weight = {1.0, 0.0, 0.0, 0.0};
  if (size == 2) try_edge(corner, 0, 1, &best);
  if (size == 3) try_triangle(corner, 0, 1, 2, &best);
  if (size == 4) try_tetrahedron(corner, &best);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < size; ++i) {
    if (!(best.weight[i] > 0.0)) continue;
    corner[kept] = corner[i];
    weight[kept++] = best.weight[i];
  }
  size = kept;
}

namespace {

class Gjk {
 public:
  Gjk(const HullCoreset& a, const HullCoreset& b, const Eigen::Isometry3d& X_BA)
      : a_(a), b_(b), R_BA_(X_BA.linear()), p_BA_(X_BA.translation()) {}

  void start(const HullSupport& support) {
    simplex_.size = 0;
    for (std::size_t i = 0; i < support.size; ++i) {
      if (support.a[i] >= a_.size() || support.b[i] >= b_.size()) continue;
      simplex_.corner[simplex_.size++] = corner(support.a[i], support.b[i]);
    }
    if (simplex_.size == 0) simplex_.corner[simplex_.size++] = corner(0, 0);
    simplex_.reduce();
  }

  HullDistance run(double precision, double enough) {
    HullDistance result;
    Eigen::Vector3d v = simplex_.nearest();
    for (int step = 0; step < kMaxDistanceSteps && simplex_.size < 4 && v.norm() > 1e-9; ++step) {
      const double distance = v.norm();
      const Eigen::Vector3d n = v / distance;
      const DifferenceSimplex::Corner next = farthest(n);
      const double bound = n.dot(next.w);
      if (bound > result.lower_bound || step == 0) {
        result.lower_bound = bound;
        result.direction = n;
      }
      if (enough > 0.0 && (bound >= enough || distance < enough)) break;
      if (bound >= distance - precision || !move_on(next)) {
        // Float has chosen the points so far.
        if (is_exact_ || precision > a_.error() + b_.error()) break;
        is_exact_ = true;
      }
      v = simplex_.nearest();
    }
    result.on_a = simplex_.on_a();
    result.on_b = simplex_.on_b();
    const double rounding =
        kLostInLength * (p_BA_.norm() + result.on_a.norm() + result.on_b.norm());
    result.lower_bound -= (a_.error() + b_.error()) * (1.0 + 1e-9) + 4.0 * rounding;
    return result;
  }

  HullSupport support() const {
    HullSupport result;
    result.size = std::min<std::size_t>(simplex_.size, 3);
    for (std::size_t i = 0; i < result.size; ++i) {
      result.a[i] = simplex_.corner[i].a;
      result.b[i] = simplex_.corner[i].b;
    }
    return result;
  }

 private:
  DifferenceSimplex::Corner corner(std::uint32_t a, std::uint32_t b) const {
    DifferenceSimplex::Corner c;
    c.on_a = R_BA_ * a_.point(a) + p_BA_;
    c.on_b = b_.point(b);
    c.w = c.on_a - c.on_b;
    c.a = a;
    c.b = b;
    return c;
  }

  DifferenceSimplex::Corner farthest(const Eigen::Vector3d& n) const {
    const Eigen::Vector3d n_A = -(R_BA_.transpose() * n);
    return is_exact_ ? corner(a_.farthest_in_double(n_A), b_.farthest_in_double(n))
                     : corner(a_.farthest(n_A), b_.farthest(n));
  }

  // @returns whether the corner leads nearer to the origin
  bool move_on(const DifferenceSimplex::Corner& next) {
    if (is_known(next)) return false;
    DifferenceSimplex larger = simplex_;
    larger.corner[larger.size++] = next;
    larger.reduce();
    if (larger.size == 0 || !(larger.nearest().squaredNorm() < simplex_.nearest().squaredNorm())) {
      return false;
    }
    simplex_ = larger;
    return true;
  }

  bool is_known(const DifferenceSimplex::Corner& c) const {
    for (std::size_t i = 0; i < simplex_.size; ++i) {
      if (simplex_.corner[i].a == c.a && simplex_.corner[i].b == c.b) return true;
    }
    return false;
  }

  const HullCoreset &a_, &b_;
  const Eigen::Matrix3d R_BA_;
  const Eigen::Vector3d p_BA_;
  DifferenceSimplex simplex_;
  bool is_exact_ = false;  // the farthest points are chosen in double
};

}  // namespace

HullDistance hull_distance(const HullCoreset& a, const HullCoreset& b,
                           const Eigen::Isometry3d& X_BA, double precision, HullSupport* support,
                           double enough) {
  Gjk gjk(a, b, X_BA);
  gjk.start(*support);
  HullDistance result = gjk.run(precision, enough);
  *support = gjk.support();
  return result;
}

}  // namespace ist
