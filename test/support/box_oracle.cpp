#include "support/box_oracle.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>

#include "support/oracle.h"

namespace ist::test {
namespace {

// Distance between the segments ab and cd.
double oracle_segments(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c,
                       const Eigen::Vector3d& d) {
  double nearest = std::min({oracle_segment(a, c, d), oracle_segment(b, c, d),
                             oracle_segment(c, a, b), oracle_segment(d, a, b)});
  // The common normal meets both segments between their ends.
  Eigen::Matrix<double, 3, 2> along;
  along << b - a, c - d;
  const Eigen::Matrix2d gram = along.transpose() * along;
  if (std::abs(gram.determinant()) < 1e-14 * gram(0, 0) * gram(1, 1)) return nearest;
  const Eigen::Vector2d s = gram.inverse() * (along.transpose() * (c - a));
  if (s.minCoeff() >= 0.0 && s.maxCoeff() <= 1.0) {
    nearest = std::min(nearest, (a + s[0] * (b - a) - c - s[1] * (d - c)).norm());
  }
  return nearest;
}

// Whether segment pq passes through triangle abc.
bool oracle_pierces(const Eigen::Vector3d& p, const Eigen::Vector3d& q, const Eigen::Vector3d& a,
                    const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const auto volume = [](const Eigen::Vector3d& u, const Eigen::Vector3d& v,
                         const Eigen::Vector3d& w,
                         const Eigen::Vector3d& x) { return (v - u).cross(w - u).dot(x - u); };
  if (volume(a, b, c, p) * volume(a, b, c, q) > 0.0) return false;
  const double s = volume(p, q, a, b), t = volume(p, q, b, c), u = volume(p, q, c, a);
  return (s >= 0.0 && t >= 0.0 && u >= 0.0) || (s <= 0.0 && t <= 0.0 && u <= 0.0);
}

}  // namespace

Eigen::Vector3d PlacedBox::corner(int k) const {
  const Eigen::Vector3d p((k & 1) != 0 ? box.max().x() : box.min().x(),
                          (k & 2) != 0 ? box.max().y() : box.min().y(),
                          (k & 4) != 0 ? box.max().z() : box.min().z());
  return X * p;
}

bool PlacedBox::contains(const Eigen::Vector3d& p) const { return box.contains(X.inverse() * p); }

double oracle_box_distance(const TriangleMesh& mesh, const PlacedBox& placed) {
  constexpr int kFace[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                               {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  std::vector<std::array<Eigen::Vector3d, 3>> sides;
  for (const auto& f : kFace) {
    const Eigen::Vector3d p[4] = {placed.corner(f[0]), placed.corner(f[1]), placed.corner(f[2]),
                                  placed.corner(f[3])};
    sides.push_back({p[0], p[1], p[2]});
    sides.push_back({p[0], p[2], p[3]});
  }
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const std::array<Eigen::Vector3d, 3> tri = {mesh.corner(t, 0), mesh.corner(t, 1),
                                                mesh.corner(t, 2)};
    if (placed.contains(tri[0])) return 0.0;
    const double longest_edge = std::max((tri[1] - tri[0]).norm(), (tri[2] - tri[0]).norm());
    const Eigen::Vector3d middle = placed.X * placed.box.center();
    if ((tri[0] - middle).norm() - longest_edge - 0.5 * placed.box.sizes().norm() > nearest)
      continue;
    for (const auto& side : sides) {
      for (std::size_t i = 0; i < 3; ++i) {
        nearest = std::min(nearest, oracle_triangle(tri[i], side[0], side[1], side[2]));
        nearest = std::min(nearest, oracle_triangle(side[i], tri[0], tri[1], tri[2]));
        const std::size_t next = (i + 1) % 3;
        if (oracle_pierces(tri[i], tri[next], side[0], side[1], side[2]) ||
            oracle_pierces(side[i], side[next], tri[0], tri[1], tri[2])) {
          return 0.0;
        }
        for (std::size_t j = 0; j < 3; ++j) {
          nearest =
              std::min(nearest, oracle_segments(tri[i], tri[next], side[j], side[(j + 1) % 3]));
        }
      }
    }
  }
  return nearest;
}

CloudSnapshot make_map(const std::vector<Eigen::AlignedBox3d>& boxes_M,
                       const Eigen::Isometry3d& X_FM) {
  auto index = std::make_shared<BoxIndex>();
  index->build(boxes_M);
  CloudSnapshot snapshot;
  snapshot.boxes = index;
  snapshot.X_FM = X_FM;
  snapshot.counts.received = snapshot.counts.used = static_cast<std::uint32_t>(boxes_M.size());
  return snapshot;
}

Eigen::AlignedBox3d random_leaf(Rng* rng, double space, double resolution, int levels) {
  const int level =
      std::min(levels - 1, static_cast<int>(-std::log2(uniform(rng, 1e-3, 1.0)) / 1.5));
  const double size = resolution * static_cast<double>(1 << level);
  Eigen::Vector3d low = random_vector(rng, space);
  for (double& v : low) v = size * std::floor(v / size);
  return {low, low + Eigen::Vector3d::Constant(size)};
}

}  // namespace ist::test
