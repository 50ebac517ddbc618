#include "interior_cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "sphere_search.h"

namespace ist {
namespace {

// Where a hole leaves no room for inner spheres, outer ones have this share of the way to the mesh,
// and of the gap that is wanted.
constexpr double kBehindHole = 0.5;

// A cell by a hole that may have an inside is taken to have one when it is as small as this share
// of the gap that is wanted.
constexpr double kUnclearSize = 0.25;
constexpr double kWindingError = 0.01;

// A cell is cut where that takes away at least this share of its half width.
constexpr double kLeastCut = 0.2;

enum class Cell { kOutside, kInside, kAtSurface, kUnclear };

// The corners of the part of a box where n.(x - center) <= end: its own, and where the plane cuts
// its edges. The plane meets at most six edges, and leaves one corner out at least.
constexpr std::size_t kMaxCorners = 13;
int cut(const Eigen::Vector3d& center, const Eigen::Vector3d& half, const Eigen::Vector3d& n,
        double end, std::array<Eigen::Vector3d, kMaxCorners>* corners) {
  std::array<Eigen::Vector3d, 8> box;
  std::array<double, 8> beyond;
  std::size_t count = 0;
  for (std::size_t k = 0; k < 8; ++k) {
    const Eigen::Vector3d arm((k & 1) != 0U ? half.x() : -half.x(),
                              (k & 2) != 0U ? half.y() : -half.y(),
                              (k & 4) != 0U ? half.z() : -half.z());
    box[k] = center + arm;
    beyond[k] = n.dot(arm) - end;
    if (beyond[k] <= 0.0) (*corners)[count++] = box[k];
  }
  for (std::size_t k = 0; k < 8; ++k) {
    for (const std::size_t step : {1U, 2U, 4U}) {
      const std::size_t other = k | step;
      if (other == k || (beyond[k] <= 0.0) == (beyond[other] <= 0.0)) continue;
      const double share = beyond[k] / (beyond[k] - beyond[other]);
      (*corners)[count++] = box[k] + share * (box[other] - box[k]);
    }
  }
  return static_cast<int>(count);
}

class InteriorCover {
 public:
  InteriorCover(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                const PackingConfig& config, SphereSearch* spheres, Packing* packing)
      : bvh_(bvh),
        finder_(finder),
        config_(config),
        // Nearer than the surface is to the spheres, the interior is of no use.
        target_(std::max(config.max_error, packing->certificate.max_gap)),
        spheres_(*spheres),
        packing_(*packing) {
    for (const InnerSphere& sphere : packing_.spheres)
      search_.add(sphere.center, sphere.cover_radius);
  }

  bool run(const PackingProgress& progress) {
    progress_ = progress;
    packing_.certificate.interior_gap = target_;
    const Eigen::AlignedBox3d box = bvh_.bounds();
    if (box.sizes().minCoeff() <= 0.0) return true;  // flat: no interior
    // Nearly cubic cells, for a long thin link too.
    const double side = std::max(box.sizes().minCoeff(), box.sizes().maxCoeff() / 64.0);
    const Eigen::Array3i n = (box.sizes().array() / side).ceil().cast<int>();
    const Eigen::Vector3d half = 0.5 * (box.sizes().array() / n.cast<double>()).matrix();
    // The first two levels by hand, so that progress is told between cells.
    const Eigen::Array3i m = 4 * n;
    const Eigen::Vector3d quarter = 0.25 * half;
    for (int i = 0; i < m.x(); ++i) {
      for (int j = 0; j < m.y(); ++j) {
        for (int k = 0; k < m.z(); ++k) {
          const Eigen::Vector3d cell(2.0 * i + 1.0, 2.0 * j + 1.0, 2.0 * k + 1.0);
          visit(box.min() + cell.cwiseProduct(quarter), quarter, 0);
        }
        done_ = static_cast<double>(i * m.y() + j + 1) / (m.x() * m.y());
        if (stopped_ || (progress && !progress(done_))) return false;
      }
    }
    return true;
  }

 private:
  // A single cell of a link that is far larger than the error wanted takes long, too.
  bool is_stopped() {
    constexpr int kStopInterval = 1024;
    if (!stopped_ && ++visits_ % kStopInterval == 0 && progress_) stopped_ = !progress_(done_);
    return stopped_;
  }

  void visit(const Eigen::Vector3d& center, const Eigen::Vector3d& half, std::uint32_t hint) {
    if (is_stopped()) return;
    std::array<Eigen::Vector3d, 8> corners;
    for (std::size_t k = 0; k < 8; ++k) {
      corners[k] = center + Eigen::Vector3d((k & 1) != 0U ? half.x() : -half.x(),
                                            (k & 2) != 0U ? half.y() : -half.y(),
                                            (k & 4) != 0U ? half.z() : -half.z());
    }
    const SphereSearch::Match match = search_.best(corners.data(), 8, hint, 0, target_);
    if (match.cost <= target_) return;
    const double radius = half.norm();
    const ClosestPoint surface = bvh_.closest(center);
    const double to_surface = std::sqrt(surface.distance_sq);
    const Cell kind = classify(center, radius, to_surface);
    if (kind == Cell::kOutside) return;
    // The surface is covered, and its inside to a depth of target_.
    if (to_surface + radius <= target_) return;
    if (to_surface < radius + target_ && is_covered_below(center, half, surface.point, match))
      return;
    const bool is_wanted =
        kind == Cell::kInside || (kind == Cell::kUnclear && radius <= kUnclearSize * target_);
    if (is_wanted && fill(center, radius, kind, match)) return;
    for (const Eigen::Vector3d& corner : corners) {
      visit(0.5 * (center + corner), 0.5 * half, match.sphere);
    }
  }

  // Whether a sphere covers what of the cell is deeper than target_: cut off across the way to the
  // nearest surface point q, or from the sphere.
  bool is_covered_below(const Eigen::Vector3d& center, const Eigen::Vector3d& half,
                        const Eigen::Vector3d& q, const SphereSearch::Match& match) const {
    if (!finder_.is_closed()) return false;
    const Eigen::Vector3d from_sphere = center - search_.center(match.sphere), from_q = center - q;
    const double side = from_q.dot(from_sphere) > 0.0 ? 1.0 : -1.0;
    return is_covered_along(side * from_q, center, half, match) ||
           is_covered_along(from_sphere, center, half, match);
  }

  // Whether a sphere covers what of the cell is deeper than target_, as far as one plane can tell.
  //
  // Beyond everything that the surface reaches along n, within target_ of the cell, all is outside
  // if one point is: it is convex, and no triangle crosses it. Points of the cell that come there
  // by a way of target_ are outside, or cross the surface on it.
  bool is_covered_along(const Eigen::Vector3d& way, const Eigen::Vector3d& center,
                        const Eigen::Vector3d& half, const SphereSearch::Match& match) const {
    const double reach = half.norm() + target_;
    const Eigen::Vector3d n = way.stableNormalized();
    if (!(n.squaredNorm() > 0.5)) return false;  // no way at all
    const double width = n.cwiseAbs().dot(half), limit = (1.0 - kLeastCut) * width + target_;
    const double highest = bvh_.support_in_sphere(center, reach, n, limit);
    if (!(highest <= limit) || highest < -reach) return false;
    if (bvh_.is_inside(center + 0.5 * (highest + reach) * n)) return false;
    std::array<Eigen::Vector3d, kMaxCorners> corners;
    const int count = cut(center, half, n, highest - target_, &corners);
    return count == 0 ||
           search_.best(corners.data(), count, match.sphere, 0, target_).cost <= target_;
  }

  // A sphere about the cell's centre, when the centre itself lacks one. False: divide the cell.
  bool fill(const Eigen::Vector3d& center, double radius, Cell kind,
            const SphereSearch::Match& match) {
    const double uncovered = search_.best(&center, 1, match.sphere, 0, 0.5 * target_).cost;
    if (uncovered <= 0.5 * target_ && 2.0 * radius > 0.5 * target_) return false;
    if (packing_.spheres.size() >= static_cast<std::size_t>(config_.max_spheres)) {
      packing_.certificate.interior_gap = std::max(packing_.certificate.interior_gap, match.cost);
      return true;
    }
    const MedialSphereFinder::InnerSphere sphere =
        kind == Cell::kInside
            ? finder_.around(center, 0.1 * target_)
            : MedialSphereFinder::InnerSphere{center, -std::sqrt(bvh_.closest(center).distance_sq)};
    const double cover_radius =
        sphere.radius < 0.0 ? kBehindHole * std::max(-sphere.radius, target_) : sphere.radius;
    packing_.spheres.push_back({sphere.center, sphere.radius, cover_radius});
    search_.add(sphere.center, cover_radius);
    spheres_.add(sphere.center, sphere.radius);
    return false;
  }

  // A cell that no triangle touches is inside or outside as its centre is. In an open mesh the
  // winding number changes smoothly instead: Harnack's inequality for positive harmonic functions
  // bounds its rise from the centre to the cell's corners.
  Cell classify(const Eigen::Vector3d& center, double radius, double distance) const {
    if (distance <= radius) return Cell::kAtSurface;
    if (finder_.is_closed()) return bvh_.is_inside(center) ? Cell::kInside : Cell::kOutside;
    const double q = radius / distance;
    const double rise = (1.0 + q) / ((1.0 - q) * (1.0 - q));
    const double quick = bvh_.quick_winding_number(center);
    if (std::max(quick + TriangleBvh::kQuickWindingError, 0.0) * rise < 0.5) return Cell::kOutside;
    const double w = bvh_.winding_number(center);
    if (std::max(w + kWindingError, 0.0) * rise < 0.5) return Cell::kOutside;
    return w > 0.5 ? Cell::kInside : Cell::kUnclear;
  }

  const TriangleBvh& bvh_;
  const MedialSphereFinder& finder_;
  const PackingConfig& config_;
  const double target_;  // [m]
  SphereSearch& spheres_;
  Packing& packing_;
  SphereSearch search_;  // cover spheres
  PackingProgress progress_;
  double done_ = 0.0;
  int visits_ = 0;
  bool stopped_ = false;
};

}  // namespace

bool cover_interior(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                    const PackingConfig& config, const PackingProgress& progress,
                    SphereSearch* spheres, Packing* packing) {
  return InteriorCover(bvh, finder, config, spheres, packing).run(progress);
}

}  // namespace ist
