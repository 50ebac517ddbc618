#include "surface_cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ist {
namespace {

// How near a new ball must come to the point it was made for, as a share of the gap there. Larger
// balls cover more of the neighbourhood; nearer ones leave less behind.
constexpr double kSlack = 0.5;
constexpr int kProgressInterval = 256;

}  // namespace

SurfaceCover::SurfaceCover(const TriangleMesh& mesh, const MedialBallFinder& finder)
    : mesh_(mesh), finder_(finder) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v);
  smallest_patch_ = 1e-7 * box.sizes().norm();
  seed();
}

Eigen::Vector3d SurfaceCover::normal(std::uint32_t t) const {
  const Eigen::Vector3d n =
      (mesh_.corner(t, 1) - mesh_.corner(t, 0)).cross(mesh_.corner(t, 2) - mesh_.corner(t, 0));
  const double norm = n.norm();
  return norm > 0.0 ? Eigen::Vector3d(n / norm) : Eigen::Vector3d::Zero();
}

// The first ball touches the largest triangle; all patches start with it.
void SurfaceCover::seed() {
  std::uint32_t largest = 0;
  double largest_area = -1.0;
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
    const double area = (mesh_.corner(t, 1) - mesh_.corner(t, 0))
                            .cross(mesh_.corner(t, 2) - mesh_.corner(t, 0))
                            .norm();
    if (area > largest_area) {
      largest_area = area;
      largest = t;
    }
  }
  const Eigen::Vector3d middle =
      (mesh_.corner(largest, 0) + mesh_.corner(largest, 1) + mesh_.corner(largest, 2)) / 3.0;
  add_ball(finder_.at_surface(middle, normal(largest), 1e3 * smallest_patch_));
  heap_.reserve(2 * mesh_.triangles.size());
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
    Patch patch{{mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2)}, 0.0, 0, 1, t};
    patch.bound = search_.best(patch.corner, 3, 0).cost;
    heap_.push_back(patch);
  }
  std::make_heap(heap_.begin(), heap_.end(), Looser());
}

void SurfaceCover::add_ball(const MedialBallFinder::InnerBall& ball) {
  balls_.push_back(ball);
  search_.add(ball.center, ball.radius);
}

void SurfaceCover::push(const Patch& patch) {
  heap_.push_back(patch);
  std::push_heap(heap_.begin(), heap_.end(), Looser());
}

// Balls added since the bound was computed may cover the patch better.
bool SurfaceCover::tighten(Patch* patch) const {
  const BallSearch::Match match = search_.best(patch->corner, 3, patch->ball, patch->seen);
  patch->seen = static_cast<std::uint32_t>(balls_.size());
  if (match.cost >= patch->bound) return false;
  patch->ball = match.ball;
  patch->bound = match.cost;
  return true;
}

void SurfaceCover::refine(const PackingConfig& config, const PackingProgress& progress) {
  const double first_bound = std::max(heap_.front().bound, config.max_error);
  double worst = first_bound;
  for (int step = 0; heap_.front().bound > config.max_error; ++step) {
    if (progress && step % kProgressInterval == 0) {
      // Balls needed grow about with the inverse of the gap.
      worst = std::min(worst, heap_.front().bound);
      if (!progress(std::min(1.0, config.max_error / worst))) return;
    }
    if (balls_.size() >= static_cast<std::size_t>(config.max_spheres)) return;
    std::pop_heap(heap_.begin(), heap_.end(), Looser());
    Patch patch = heap_.back();
    heap_.pop_back();
    if (tighten(&patch)) {
      push(patch);
    } else {
      split_or_fill(patch, config.max_error);
    }
  }
}

void SurfaceCover::split_or_fill(const Patch& patch, double target) {
  // The gap at the patch's own points is a lower bound of what a split could prove.
  const Eigen::Vector3d middle = (patch.corner[0] + patch.corner[1] + patch.corner[2]) / 3.0;
  Eigen::Vector3d worst_point = middle;
  double worst_gap = search_.best(&middle, 1, patch.ball).cost;
  for (const Eigen::Vector3d& corner : patch.corner) {
    // A little inside the patch: a corner belongs to faces of other normals too.
    const Eigen::Vector3d point = 0.98 * corner + 0.02 * middle;
    const double gap = search_.best(&point, 1, patch.ball).cost;
    if (gap > worst_gap) {
      worst_gap = gap;
      worst_point = point;
    }
  }
  const double edge = std::max({(patch.corner[0] - patch.corner[1]).norm(),
                                (patch.corner[1] - patch.corner[2]).norm(),
                                (patch.corner[2] - patch.corner[0]).norm()});
  if (worst_gap < std::max(0.75 * patch.bound, 0.98 * target) && edge > smallest_patch_) {
    split(patch);
    return;
  }
  const double slack = kSlack * std::max(std::min(worst_gap, patch.bound), 0.5 * target);
  add_ball(finder_.at_surface(worst_point, normal(patch.triangle), slack));
  push(patch);
}

// Halves the longest edge: two patches of the same triangle, covering it without overlap.
void SurfaceCover::split(const Patch& patch) {
  int longest = 0;
  double length_sq = -1.0;
  for (int k = 0; k < 3; ++k) {
    const double edge_sq = (patch.corner[k] - patch.corner[(k + 1) % 3]).squaredNorm();
    if (edge_sq > length_sq) {
      length_sq = edge_sq;
      longest = k;
    }
  }
  const int a = longest, b = (longest + 1) % 3;
  const Eigen::Vector3d middle = 0.5 * (patch.corner[a] + patch.corner[b]);
  for (const int replaced : {a, b}) {
    Patch half = patch;
    half.corner[replaced] = middle;
    half.seen = 0;  // another ball may suit the smaller patch
    // The parent's bound holds for its parts too, whatever the search says.
    tighten(&half);
    push(half);
  }
}

void SurfaceCover::certify(Packing* packing) {
  packing->balls.clear();
  packing->balls.reserve(balls_.size());
  for (const MedialBallFinder::InnerBall& ball : balls_) {
    packing->balls.push_back({ball.center, ball.radius, ball.radius});
  }
  PackingCertificate& certificate = packing->certificate;
  double weighted = 0.0;
  for (Patch& patch : heap_) {
    tighten(&patch);
    Ball& ball = packing->balls[patch.ball];
    const double gap = std::max(0.0, patch.bound);
    ball.cover_radius = std::max(ball.cover_radius, ball.radius + gap);
    certificate.max_gap = std::max(certificate.max_gap, gap);
    const double area =
        0.5 * (patch.corner[1] - patch.corner[0]).cross(patch.corner[2] - patch.corner[0]).norm();
    certificate.surface_area += area;
    weighted += area * gap;
    if (ball.radius == 0.0) certificate.unreachable_area += area;
  }
  certificate.mean_gap = certificate.surface_area > 0.0 ? weighted / certificate.surface_area : 0.0;
}

}  // namespace ist
