#include "support/link_pair_oracle.h"

#include <utility>
#include <variant>

#include "support/oracle.h"

namespace ist::test {
namespace {

// Round shapes are inscribed by this many sides.
constexpr int kSidesOfRoundShapes = 160;
constexpr double kAngleOfSide = 2.0 * 3.14159265358979323846 / kSidesOfRoundShapes;

void append_triangles(const TriangleMesh& mesh, const Eigen::Isometry3d& X_LE,
                      std::vector<Corners3<double>>* triangles) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Corners3<double> corners;
    for (int k = 0; k < 3; ++k) corners.p[k] = X_LE * mesh.corner(t, k);
    triangles->push_back(corners);
  }
}

void append_triangles(const Box& box, const Eigen::Isometry3d& X_LE,
                      std::vector<Corners3<double>>* triangles) {
  for (int face = 0; face < 6; ++face) {
    const int axis = face / 2;
    Eigen::Vector3d corner[4];
    for (int k = 0; k < 4; ++k) {
      corner[k][axis] = (face % 2 - 0.5) * box.size[axis];
      corner[k][(axis + 1) % 3] = (k == 1 || k == 2 ? 0.5 : -0.5) * box.size[(axis + 1) % 3];
      corner[k][(axis + 2) % 3] = (k >= 2 ? 0.5 : -0.5) * box.size[(axis + 2) % 3];
      corner[k] = X_LE * corner[k];
    }
    triangles->push_back({{corner[0], corner[1], corner[2]}});
    triangles->push_back({{corner[0], corner[2], corner[3]}});
  }
}

// Appends the triangles of a profile (radius, z) that turns about z, from below to above.
void append_turned(const std::vector<Eigen::Vector2d>& profile, const Eigen::Isometry3d& X_LE,
                   std::vector<Corners3<double>>* triangles) {
  const auto point = [&](const Eigen::Vector2d& p, int k) {
    const double angle = kAngleOfSide * (k % kSidesOfRoundShapes);
    return Eigen::Vector3d(
        X_LE * Eigen::Vector3d(p.x() * std::cos(angle), p.x() * std::sin(angle), p.y()));
  };
  for (std::size_t i = 0; i + 1 < profile.size(); ++i) {
    for (int k = 0; k < kSidesOfRoundShapes; ++k) {
      const auto a = point(profile[i], k), b = point(profile[i], k + 1);
      const auto c = point(profile[i + 1], k), d = point(profile[i + 1], k + 1);
      if (profile[i].x() > 0.0) triangles->push_back({{a, b, d}});
      if (profile[i + 1].x() > 0.0) triangles->push_back({{a, d, c}});
    }
  }
}

// The profile of a cylinder, in pieces, because spheres about slivers are large.
std::vector<Eigen::Vector2d> profile_of(const Cylinder& cylinder) {
  const double r = cylinder.radius, h = 0.5 * cylinder.length;
  std::vector<Eigen::Vector2d> profile;
  const auto add = [&](const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
    const int pieces = static_cast<int>(std::ceil((to - from).norm() / (0.2 * r)));
    for (int i = 0; i < pieces; ++i) profile.push_back(from + i * (to - from) / pieces);
  };
  add({0.0, -h}, {r, -h});
  add({r, -h}, {r, h});
  add({r, h}, {0.0, h});
  profile.emplace_back(0.0, h);
  return profile;
}

std::vector<Eigen::Vector2d> profile_of(const Sphere& sphere) {
  std::vector<Eigen::Vector2d> profile;
  for (int i = 0; i <= kSidesOfRoundShapes / 2; ++i) {
    const bool is_pole = i == 0 || i == kSidesOfRoundShapes / 2;
    profile.emplace_back(is_pole ? 0.0 : sphere.radius * std::sin(kAngleOfSide * i),
                         -sphere.radius * std::cos(kAngleOfSide * i));
  }
  return profile;
}

}  // namespace

TriangleGroups::TriangleGroups(std::vector<Corners3<double>> triangles)
    : triangles_(std::move(triangles)) {
  if (triangles_.empty()) return;  // a link of curved shapes
  divide(0, triangles_.size());
  for (const auto& t : triangles_) {
    for (const auto& p : t.p) box_.extend(p);
  }
  for (const auto& t : triangles_) spheres_.push_back(sphere_of(&t, &t + 1));
}

double TriangleGroups::distance(const TriangleGroups& other, const Eigen::Isometry3d& X) const {
  double best = std::numeric_limits<double>::infinity();
  if (!groups_.empty() && !other.groups_.empty()) descend(0, other, 0, X, &best);
  return best;
}

bool TriangleGroups::holds_part_of(const TriangleGroups& other, const Eigen::Isometry3d& X) const {
  for (const Group& group : other.groups_) {
    if (group.right != 0) continue;
    if (contains(X * other.triangles_[group.first].p[0])) return true;
  }
  return false;
}

bool TriangleGroups::contains(const Eigen::Vector3d& p) const {
  if (!box_.contains(p)) return false;
  double angle = 0.0;
  for (const auto& t : triangles_) angle += oracle_solid_angle(t.p[0] - p, t.p[1] - p, t.p[2] - p);
  return angle > 0.5 * 4.0 * 3.14159265358979323846;
}

TriangleGroups::Ball TriangleGroups::posed(const Ball& ball, const Eigen::Isometry3d& X) {
  return {X * ball.center, ball.radius};
}

double TriangleGroups::slab(const Eigen::Vector3d& n, const Corners3<double>& a,
                            const Corners3<double>& b) {
  const double norm = n.norm();
  if (!(norm > 0.0)) return 0.0;
  const auto along = [&](const Corners3<double>& t) {
    const double x = n.dot(t.p[0]), y = n.dot(t.p[1]), z = n.dot(t.p[2]);
    return std::pair<double, double>{std::min({x, y, z}), std::max({x, y, z})};
  };
  const auto of_a = along(a), of_b = along(b);
  return std::max(of_b.first - of_a.second, of_a.first - of_b.second) / norm - 1e-12;
}

double TriangleGroups::slab(const Ball& a, const Ball& b, const Eigen::Isometry3d& X) {
  const Eigen::Vector3d between = X * b.center - a.center;
  const double norm = between.norm();
  if (!(norm > 0.0)) return 0.0;
  const Eigen::Vector3d n = between / norm;
  return norm - n.cwiseAbs().dot(a.half) - (X.linear().transpose() * n).cwiseAbs().dot(b.half) -
         1e-12;
}

double TriangleGroups::bound(const Group& a, const Group& b, const Eigen::Isometry3d& X) {
  return std::max(gap(a.sphere, posed(b.sphere, X)), slab(a.sphere, b.sphere, X));
}

double TriangleGroups::gap(const Ball& a, const Ball& b) {
  return (a.center - b.center).norm() - a.radius - b.radius - 1e-12;
}

TriangleGroups::Ball TriangleGroups::sphere_of(const Corners3<double>* begin,
                                               const Corners3<double>* end) {
  Eigen::AlignedBox3d box;
  for (auto* t = begin; t != end; ++t) {
    for (const auto& p : t->p) box.extend(p);
  }
  Ball ball{box.center(), 0.0, 0.5 * box.sizes()};
  for (auto* t = begin; t != end; ++t) {
    for (const auto& p : t->p) ball.radius = std::max(ball.radius, (p - ball.center).norm());
  }
  return ball;
}

Eigen::Vector3d TriangleGroups::normal(const Corners3<double>& t) {
  return (t.p[1] - t.p[0]).cross(t.p[2] - t.p[0]);
}

void TriangleGroups::compare(const Group& a, const TriangleGroups& other, const Group& b,
                             const Eigen::Isometry3d& X, double* best) const {
  for (std::size_t k = b.first; k < b.last; ++k) {
    const Ball ball = posed(other.spheres_[k], X);
    if (gap(a.sphere, ball) >= *best) continue;
    Corners3<double> t = other.triangles_[k];
    for (auto& p : t.p) p = X * p;
    for (std::size_t i = a.first; i < a.last; ++i) {
      if (gap(spheres_[i], ball) >= *best) continue;
      const Corners3<double>& own = triangles_[i];
      if (slab(ball.center - spheres_[i].center, own, t) >= *best ||
          slab(normal(own), own, t) >= *best || slab(normal(t), own, t) >= *best) {
        continue;
      }
      *best = std::min(*best, oracle_triangles(own, t));
    }
  }
}

void TriangleGroups::descend(std::size_t a, const TriangleGroups& other, std::size_t b,
                             const Eigen::Isometry3d& X, double* best) const {
  const Group &of_a = groups_[a], &of_b = other.groups_[b];
  if (bound(of_a, of_b, X) >= *best) return;
  if (of_a.right == 0 && of_b.right == 0) return compare(of_a, other, of_b, X, best);
  const bool halves_a =
      of_b.right == 0 || (of_a.right != 0 && of_a.sphere.radius >= of_b.sphere.radius);
  std::pair<std::size_t, std::size_t> halves[2];
  double gaps[2];
  for (int i = 0; i < 2; ++i) {
    halves[i] = {halves_a ? (i == 0 ? a + 1 : of_a.right) : a,
                 halves_a ? b : (i == 0 ? b + 1 : of_b.right)};
    gaps[i] = bound(groups_[halves[i].first], other.groups_[halves[i].second], X);
  }
  const int nearer = gaps[1] < gaps[0] ? 1 : 0;
  for (const int i : {nearer, 1 - nearer}) {
    descend(halves[i].first, other, halves[i].second, X, best);
  }
}

void TriangleGroups::divide(std::size_t first, std::size_t last) {
  const std::size_t group = groups_.size();
  groups_.push_back(
      {first, last, sphere_of(&triangles_[first], &triangles_[first] + (last - first))});
  if (last - first <= kGroup) return;
  Eigen::AlignedBox3d box;
  for (std::size_t i = first; i < last; ++i) box.extend(triangles_[i].p[0]);
  Eigen::Index axis;
  box.sizes().maxCoeff(&axis);
  const std::size_t middle = (first + last) / 2;
  std::nth_element(triangles_.begin() + static_cast<std::ptrdiff_t>(first),
                   triangles_.begin() + static_cast<std::ptrdiff_t>(middle),
                   triangles_.begin() + static_cast<std::ptrdiff_t>(last),
                   [axis](const auto& a, const auto& b) { return a.p[0][axis] < b.p[0][axis]; });
  divide(first, middle);
  groups_[group].right = groups_.size();
  divide(middle, last);
}

std::vector<Corners3<double>> triangles_of(const LinkGeometry& link) {
  std::vector<Corners3<double>> triangles;
  for (const GeometryElement& element : link) {
    if (const auto* mesh = std::get_if<TriangleMesh>(&element.shape)) {
      append_triangles(*mesh, element.X_LE, &triangles);
    } else if (const auto* box = std::get_if<Box>(&element.shape)) {
      append_triangles(*box, element.X_LE, &triangles);
    }
  }
  return triangles;
}

double append_round_shapes(const LinkGeometry& link, std::vector<Corners3<double>>* triangles) {
  const double sagitta = 1.0 - std::cos(0.5 * kAngleOfSide);  // of radius 1
  double inexactness = 0.0;
  for (const GeometryElement& element : link) {
    if (const auto* cylinder = std::get_if<Cylinder>(&element.shape)) {
      append_turned(profile_of(*cylinder), element.X_LE, triangles);
      inexactness = std::max(inexactness, cylinder->radius * sagitta);
    } else if (const auto* sphere = std::get_if<Sphere>(&element.shape)) {
      append_turned(profile_of(*sphere), element.X_LE, triangles);
      // A quadrangle spans the angle of a side both along and across.
      inexactness = std::max(inexactness, sphere->radius * 2.0 * sagitta);
    }
  }
  return inexactness;
}

}  // namespace ist::test
