#include "interior_cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "internal/geometry/boundary_edges.h"
#include "sphere_search.h"

namespace ist {
namespace {

// The cover sphere has this share of the distance to the mesh where a hole admits no inner sphere,
// or of the wanted gap if that is larger.
constexpr double kHoleCoverRadius = 0.5;

// A cell near a hole that may contain interior points counts as interior when its circumradius is
// at most this share of the wanted gap.
constexpr double kMaxUnclearSize = 0.25;
constexpr double kWindingError = 0.01;

// cover_interior() covers every interior cell of half its target size with a sphere. A cell that is
// smaller than this share of the target and not covered shows that the packing is another one.
constexpr double kMinCheckedSize = 0.1;
// Cells that a check visits at most: about 20 s.
constexpr std::size_t kMaxCheckedCells = 10000000;

// A cell is clipped where that takes away at least this share of its half width.
constexpr double kMinClip = 0.2;

enum class CellKind { kOutside, kInside, kAtSurface, kUnclear };

// Corner k of the box: bit 0, 1, 2 choose the side along x, y, z.
Eigen::Vector3d box_corner(const Eigen::Vector3d& center, const Eigen::Vector3d& half,
                           std::size_t k) {
  return center + Eigen::Vector3d((k & 1) != 0U ? half.x() : -half.x(),
                                  (k & 2) != 0U ? half.y() : -half.y(),
                                  (k & 4) != 0U ? half.z() : -half.z());
}

// The vertices of a box clipped to the half-space n.(x - center) <= offset: the box's corners in
// it, and the points where the plane cuts edges. The plane cuts at most six edges, and at least one
// corner lies outside.
constexpr std::size_t kMaxVertices = 13;
int clip_box(const Eigen::Vector3d& center, const Eigen::Vector3d& half, const Eigen::Vector3d& n,
             double offset, std::array<Eigen::Vector3d, kMaxVertices>* vertices) {
  std::array<Eigen::Vector3d, 8> corners;
  std::array<double, 8> height;  // [m] above the plane
  std::size_t count = 0;
  for (std::size_t k = 0; k < 8; ++k) {
    corners[k] = box_corner(center, half, k);
    height[k] = n.dot(box_corner(Eigen::Vector3d::Zero(), half, k)) - offset;
    if (height[k] <= 0.0) (*vertices)[count++] = corners[k];
  }
  for (std::size_t k = 0; k < 8; ++k) {
    for (const std::size_t axis_bit : {1U, 2U, 4U}) {
      const std::size_t other = k | axis_bit;
      if (other == k || (height[k] <= 0.0) == (height[other] <= 0.0)) continue;
      const double share = height[k] / (height[k] - height[other]);
      (*vertices)[count++] = corners[k] + share * (corners[other] - corners[k]);
    }
  }
  return static_cast<int>(count);
}

// An octree over the mesh's box. Cells are divided until they are outside, covered by a sphere,
// covered by the surface, or done as the derived class has it.
class InteriorOctree {
 public:
  InteriorOctree(const InteriorOctree&) = delete;
  InteriorOctree& operator=(const InteriorOctree&) = delete;

  // False when it was stopped.
  bool run() {
    const Eigen::AlignedBox3d box = bvh_.bounds();
    if (box.sizes().minCoeff() <= 0.0) return true;  // flat: no interior
    // Nearly cubic cells, for a long thin link too.
    const double side = std::max(box.sizes().minCoeff(), box.sizes().maxCoeff() / 64.0);
    const Eigen::Array3i n = (box.sizes().array() / side).ceil().cast<int>();
    const Eigen::Vector3d half = 0.5 * (box.sizes().array() / n.cast<double>()).matrix();
    // The first two levels are divided here, so that progress is reported between cells.
    const Eigen::Array3i m = 4 * n;
    const Eigen::Vector3d quarter = 0.25 * half;
    for (int i = 0; i < m.x(); ++i) {
      for (int j = 0; j < m.y(); ++j) {
        for (int k = 0; k < m.z(); ++k) {
          const Eigen::Vector3d cell(2.0 * i + 1.0, 2.0 * j + 1.0, 2.0 * k + 1.0);
          visit(box.min() + cell.cwiseProduct(quarter), quarter, 0);
        }
        if (!watch_.report(static_cast<double>(i * m.y() + j + 1) / (m.x() * m.y()))) return false;
      }
    }
    return true;
  }

 protected:
  InteriorOctree(const TriangleBvh& bvh, bool is_closed, double target, PackingWatch* watch)
      : bvh_(bvh), is_closed_(is_closed), target_(target), watch_(*watch) {}
  ~InteriorOctree() = default;

  // Decides about an interior cell that no sphere and no surface covers. False: the cell must be
  // divided.
  // @param match  the sphere that covers it best
  virtual bool is_done(const Eigen::Vector3d& center, double circumradius, CellKind kind,
                       const SphereSearch::Match& match) = 0;

  const TriangleBvh& bvh_;
  const bool is_closed_;
  const double target_;  // [m] wanted gap
  PackingWatch& watch_;
  SphereSearch search_;      // cover spheres
  bool is_decided_ = false;  // nothing more need be looked at

 private:
  // Covers the interior points of a cell, dividing it where that is needed.
  void visit(const Eigen::Vector3d& center, const Eigen::Vector3d& half, std::uint32_t hint) {
    if (is_decided_ || !watch_.keeps_on())
      return;  // a single cell takes long in a link that is large
    std::array<Eigen::Vector3d, 8> corners;
    for (std::size_t k = 0; k < 8; ++k) corners[k] = box_corner(center, half, k);
    const SphereSearch::Match match = search_.best(corners.data(), 8, hint, 0, target_);
    if (match.cost <= target_) return;
    const double circumradius = half.norm();
    const ClosestPoint surface = bvh_.closest(center);
    const double distance = std::sqrt(surface.distance_sq);
    const CellKind kind = classify(center, circumradius, distance);
    if (kind == CellKind::kOutside) return;
    // The surface is covered, and with it the interior down to a depth of target_.
    if (distance + circumradius <= target_) return;
    if (distance < circumradius + target_ && is_covered_below(center, half, surface.point, match)) {
      return;
    }
    const bool is_interior =
        kind == CellKind::kInside ||
        (kind == CellKind::kUnclear && circumradius <= kMaxUnclearSize * target_);
    if (is_interior && is_done(center, circumradius, kind, match)) return;
    for (const Eigen::Vector3d& corner : corners) {
      visit(0.5 * (center + corner), 0.5 * half, match.sphere);
    }
  }

  // Whether one cover sphere covers all interior points of the cell that are deeper than target_.
  // Two planes may show it: across the line to the nearest surface point q, and across the line to
  // the sphere's centre.
  bool is_covered_below(const Eigen::Vector3d& center, const Eigen::Vector3d& half,
                        const Eigen::Vector3d& q, const SphereSearch::Match& match) const {
    if (!is_closed_) return false;
    const Eigen::Vector3d from_sphere = center - search_.center(match.sphere), from_q = center - q;
    const double side = from_q.dot(from_sphere) > 0.0 ? 1.0 : -1.0;
    return is_covered_along(side * from_q, center, half, match) ||
           is_covered_along(from_sphere, center, half, match);
  }

  // The same, shown by the supporting plane of the surface near the cell in one direction n. Let h
  // be the support (the largest n.x) of the surface within target_ of the cell. The region above h
  // is convex and no triangle crosses it, so it is outside if one of its points is. Points of the
  // cell above h - target_ are outside or within target_ of the surface, since a movement by
  // target_ along n leads to that region. The rest of the cell is clipped off and must be covered.
  bool is_covered_along(const Eigen::Vector3d& direction, const Eigen::Vector3d& center,
                        const Eigen::Vector3d& half, const SphereSearch::Match& match) const {
    const double radius = half.norm() + target_;
    const Eigen::Vector3d n = direction.stableNormalized();
    if (!(n.squaredNorm() > 0.5)) return false;  // no direction
    const double half_width = n.cwiseAbs().dot(half);
    const double limit = (1.0 - kMinClip) * half_width + target_;
    const double support = bvh_.support_in_sphere(center, radius, n);
    if (!(support <= limit) || support < -radius) return false;
    if (bvh_.is_inside(center + 0.5 * (support + radius) * n)) return false;
    std::array<Eigen::Vector3d, kMaxVertices> vertices;
    const int count = clip_box(center, half, n, support - target_, &vertices);
    return count == 0 ||
           search_.best(vertices.data(), count, match.sphere, 0, target_).cost <= target_;
  }

  // A cell that no triangle touches is on the side of its centre. In an open mesh the winding
  // number changes smoothly instead: it is harmonic off the mesh, and Harnack's inequality bounds
  // its rise from the centre to the cell's corners.
  CellKind classify(const Eigen::Vector3d& center, double circumradius, double distance) const {
    if (distance <= circumradius) return CellKind::kAtSurface;
    if (is_closed_) {
      return bvh_.is_inside(center) ? CellKind::kInside : CellKind::kOutside;
    }
    const double q = circumradius / distance;
    const double rise = (1.0 + q) / ((1.0 - q) * (1.0 - q));
    double error;
    const double quick = bvh_.quick_winding_number(center, &error);
    if (std::max(quick + error, 0.0) * rise < 0.5) {
      return CellKind::kOutside;
    }
    const double w = bvh_.winding_number(center);
    if (std::max(w + kWindingError, 0.0) * rise < 0.5) return CellKind::kOutside;
    return w > 0.5 ? CellKind::kInside : CellKind::kUnclear;
  }
};

// Adds a sphere where a cell is not covered.
class InteriorCover final : public InteriorOctree {
 public:
  InteriorCover(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                const PackingConfig& config, PackingWatch* watch, SphereSearch* spheres,
                Packing* packing)
      // The interior need not be covered more tightly than the surface.
      : InteriorOctree(bvh, finder.is_closed(),
                       std::max(config.max_error, packing->certificate.max_gap), watch),
        finder_(finder),
        config_(config),
        spheres_(*spheres),
        packing_(*packing) {
    for (const InnerSphere& sphere : packing_.spheres) {
      search_.add(sphere.center, sphere.cover_radius);
    }
    packing_.certificate.interior_gap = target_;
  }

 private:
  // Adds a sphere about the cell's centre if the centre is not covered well. False: the cell must
  // be divided. True: no further sphere is allowed, and the cell's gap is in the certificate.
  bool is_done(const Eigen::Vector3d& center, double circumradius, CellKind kind,
               const SphereSearch::Match& match) override {
    const double gap = search_.best(&center, 1, match.sphere, 0, 0.5 * target_).cost;
    if (gap <= 0.5 * target_ && 2.0 * circumradius > 0.5 * target_) return false;
    if (packing_.spheres.size() >= static_cast<std::size_t>(config_.max_spheres)) {
      packing_.certificate.interior_gap = std::max(packing_.certificate.interior_gap, match.cost);
      return true;
    }
    const MedialSphere sphere =
        kind == CellKind::kInside
            ? finder_.containing(center, 0.1 * target_)
            : MedialSphere{center, -std::sqrt(bvh_.closest(center).distance_sq)};
    const double cover_radius =
        sphere.radius < 0.0 ? kHoleCoverRadius * std::max(-sphere.radius, target_) : sphere.radius;
    packing_.spheres.push_back({sphere.center, sphere.radius, cover_radius});
    search_.add(sphere.center, cover_radius);
    spheres_.add(sphere.center, sphere.radius);
    return false;
  }

  const MedialSphereFinder& finder_;
  const PackingConfig& config_;
  SphereSearch& spheres_;
  Packing& packing_;
};

// Finds a cell that a packing should have covered.
class InteriorCheck final : public InteriorOctree {
 public:
  InteriorCheck(const TriangleMesh& mesh, const TriangleBvh& bvh, const Packing& packing,
                double deviation, double gap, PackingWatch* watch)
      : InteriorOctree(bvh, is_closed_mesh(mesh, [watch] { return !watch->keeps_on(); }), gap,
                       watch) {
    for (const InnerSphere& sphere : packing.spheres) {
      search_.add(sphere.center, sphere.cover_radius - deviation);
    }
  }

  bool is_covered() { return run() && !is_decided_; }

 private:
  bool is_done(const Eigen::Vector3d&, double circumradius, CellKind,
               const SphereSearch::Match&) override {
    const bool is_small = circumradius <= kMinCheckedSize * target_;
    is_decided_ = is_small || ++cells_ > kMaxCheckedCells;
    return is_decided_;
  }

  std::size_t cells_ = 0;
};

}  // namespace

bool cover_interior(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                    const PackingConfig& config, PackingWatch* watch, SphereSearch* spheres,
                    Packing* packing) {
  return InteriorCover(bvh, finder, config, watch, spheres, packing).run();
}

bool is_interior_covered(const TriangleMesh& mesh, const TriangleBvh& bvh, const Packing& packing,
                         double deviation, double gap, PackingWatch* watch) {
  return InteriorCheck(mesh, bvh, packing, deviation, gap, watch).is_covered();
}

}  // namespace ist
