#include "surface_cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "clearance_climb.h"

namespace ist {
namespace {

// How near new spheres that are tried come to the point they are made for, as shares of the gap
// there. Those that leave more of it are larger.
constexpr double kSlacks[] = {0.6, 0.33, 0.15};
// As much of the gap a disjoint sphere may leave, if it is the largest of its neighbourhood.
constexpr double kLooseSlack = 0.9;
constexpr int kProgressInterval = 256;
// Searches for a sphere that no hole speaks against.
constexpr int kMaxTries = 8;

// A patch whose gap is known to be this share of its bound gets a sphere; else it is split.
constexpr double kTight = 0.8;
// The same, when no more spheres come: how near the certificate is to the truth.
constexpr double kSharp = 0.95;
constexpr std::size_t kMaxSharpenings = 1000000;

}  // namespace

SurfaceCover::SurfaceCover(const TriangleMesh& mesh, const MedialSphereFinder& finder,
                           SphereSearch* search)
    : mesh_(mesh), finder_(finder), search_(*search) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v);
  smallest_patch_ = 1e-7 * box.sizes().norm();
}

Eigen::Vector3d SurfaceCover::normal(std::uint32_t t) const {
  const Eigen::Vector3d n =
      (mesh_.corner(t, 1) - mesh_.corner(t, 0)).cross(mesh_.corner(t, 2) - mesh_.corner(t, 0));
  const double norm = n.norm();
  return norm > 0.0 ? Eigen::Vector3d(n / norm) : Eigen::Vector3d::Zero();
}

bool SurfaceCover::fill_hole(double at_least, VolumeFiller* holes) {
  if (holes == nullptr) return false;
  const auto sphere = holes->next(at_least);
  if (sphere) add_sphere(*sphere);
  return sphere.has_value();
}

// What a search finds, repeated where a hole speaks against it; at last the surface point s itself.
template <class Search>
MedialSphereFinder::InnerSphere SurfaceCover::admitted(const Eigen::Vector3d& s,
                                                       const Search& search) const {
  for (int i = 0; i < kMaxTries; ++i) {
    MedialSphereFinder::InnerSphere sphere = search();
    if (finder_.is_closed() || sphere.radius <= 0.0 || finder_.admits(sphere)) return sphere;
  }
  return {s, 0.0};
}

// The first sphere is as large as it gets, or touches the largest triangle.
void SurfaceCover::seed(VolumeFiller* holes) {
  if (fill_hole(0.0, holes)) return;
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
  const double slack = 1e3 * smallest_patch_;
  add_sphere(admitted(middle, [&] { return finder_.at_surface(middle, normal(largest), slack); }));
}

void SurfaceCover::cover_triangles() {
  // Room that is not used costs no memory; to move patches for more room does.
  patches_.reserve(2 * mesh_.triangles.size());
  heap_.reserve(2 * mesh_.triangles.size());
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
    Patch patch{{mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2)}, 0.0, 0, 0, t};
    const SphereSearch::Match match = search_.best(patch.corner, 3, 0);
    patch.bound = match.cost;
    patch.sphere = match.sphere;
    patch.seen = static_cast<std::uint32_t>(spheres_.size());
    patches_.push_back(patch);
    heap_.push_back({patch.bound, t});
  }
  std::make_heap(heap_.begin(), heap_.end(), Looser());
}

void SurfaceCover::add_sphere(const MedialSphereFinder::InnerSphere& sphere) {
  spheres_.push_back(sphere);
  search_.add(sphere.center, sphere.radius);
}

void SurfaceCover::push(std::uint32_t index) {
  heap_.push_back({patches_[index].bound, index});
  std::push_heap(heap_.begin(), heap_.end(), Looser());
}

// The patch with the largest bound.
std::uint32_t SurfaceCover::pop() {
  std::pop_heap(heap_.begin(), heap_.end(), Looser());
  const std::uint32_t patch = heap_.back().patch;
  heap_.pop_back();
  return patch;
}

// Spheres added since the bound was computed may cover the patch better.
bool SurfaceCover::tighten(Patch* patch) const {
  const SphereSearch::Match match = search_.best(patch->corner, 3, patch->sphere, patch->seen);
  patch->seen = static_cast<std::uint32_t>(spheres_.size());
  if (match.cost >= patch->bound) return false;
  patch->sphere = match.sphere;
  patch->bound = match.cost;
  return true;
}

void SurfaceCover::refine(const PackingConfig& config, VolumeFiller* holes,
                          const PackingProgress& progress) {
  seed(holes);
  cover_triangles();
  // In the order of volume every hole comes first; else one whose centre is as far from all spheres
  // as the worst patch.
  const double hole_share = config.order == PackingOrder::kVolume ? 0.0 : 1.0;
  const double first_bound = std::max(heap_.front().bound, config.max_error);
  double worst = first_bound;
  for (int step = 0; heap_.front().bound > config.max_error; ++step) {
    if (progress && step % kProgressInterval == 0) {
      // Spheres needed grow about with the inverse of the gap.
      worst = std::min(worst, heap_.front().bound);
      if (!progress(std::min(1.0, config.max_error / worst))) return;
    }
    if (spheres_.size() >= static_cast<std::size_t>(config.max_spheres)) return;
    const std::uint32_t index = pop();
    Patch& patch = patches_[index];
    if (tighten(&patch) || fill_hole(hole_share * patch.bound, holes)) {
      push(index);
    } else {
      split_or_fill(index, config.max_error);
    }
  }
}

// The largest gap at the patch's own points: a lower bound of what a split could prove.
double SurfaceCover::gap_at_points(const Patch& patch, Eigen::Vector3d* worst_point) const {
  const Eigen::Vector3d middle = (patch.corner[0] + patch.corner[1] + patch.corner[2]) / 3.0;
  *worst_point = middle;
  double worst_gap = search_.best(&middle, 1, patch.sphere).cost;
  for (const Eigen::Vector3d& corner : patch.corner) {
    // A little inside the patch: a corner belongs to faces of other normals too.
    const Eigen::Vector3d point = 0.98 * corner + 0.02 * middle;
    const double gap = search_.best(&point, 1, patch.sphere, 0, worst_gap).cost;
    if (gap > worst_gap) {
      worst_gap = gap;
      *worst_point = point;
    }
  }
  return worst_gap;
}

double SurfaceCover::longest_edge(const Patch& patch) {
  return std::max({(patch.corner[0] - patch.corner[1]).norm(),
                   (patch.corner[1] - patch.corner[2]).norm(),
                   (patch.corner[2] - patch.corner[0]).norm()});
}

void SurfaceCover::split_or_fill(std::uint32_t index, double target) {
  const Patch& patch = patches_[index];
  Eigen::Vector3d worst_point;
  const double worst_gap = gap_at_points(patch, &worst_point);
  if (worst_gap < std::max(kTight * patch.bound, 0.98 * target) &&
      longest_edge(patch) > smallest_patch_) {
    split(index);
    return;
  }
  const double gap = std::max(std::min(worst_gap, patch.bound), 0.5 * target);
  add_sphere(sphere_at(worst_point, patch.triangle, gap));
  push(index);
}

MedialSphereFinder::InnerSphere SurfaceCover::sphere_at(const Eigen::Vector3d& s,
                                                        std::uint32_t triangle, double gap) const {
  return admitted(s, [&] { return candidate(s, triangle, gap); });
}

MedialSphereFinder::InnerSphere SurfaceCover::candidate(const Eigen::Vector3d& s,
                                                        std::uint32_t triangle, double gap) const {
  const auto left = [&s](const MedialSphereFinder::InnerSphere& sphere) {
    return (sphere.center - s).norm() - sphere.radius;
  };
  // On a flat face a sphere covers, to within the gap, an area that grows with its radius and with
  // what it leaves of the gap. The square serves better where faces end.
  MedialSphereFinder::InnerSphere best{s, 0.0};
  double best_score = 0.0;
  for (const double slack : kSlacks) {
    if (finder_.is_disjoint() && best.radius > 0.0) break;  // it is a start to climb from
    const MedialSphereFinder::InnerSphere sphere =
        finder_.at_surface(s, normal(triangle), slack * gap);
    const double closed = std::max(0.0, gap - left(sphere));
    const double score = sphere.radius * closed * closed;
    if (score <= best_score) continue;
    best_score = score;
    best = sphere;
  }
  if (!finder_.is_disjoint() || best.radius <= 0.0) return best;
  const MedialSphereFinder::InnerSphere top = climb(finder_, best.center);
  return left(top) <= kLooseSlack * gap ? top : best;
}

void SurfaceCover::sharpen() {
  double known = 0.0;  // [m] a gap that is there
  for (std::size_t i = 0; i < kMaxSharpenings; ++i) {
    const std::uint32_t index = pop();
    Patch& patch = patches_[index];
    if (tighten(&patch)) {
      push(index);
      continue;
    }
    Eigen::Vector3d worst_point;
    known = std::max(known, gap_at_points(patch, &worst_point));
    if (kSharp * patch.bound <= known || longest_edge(patch) <= smallest_patch_) {
      push(index);
      return;
    }
    split(index);
  }
}

// Halves the longest edge: two patches of the same triangle, covering it without overlap.
void SurfaceCover::split(std::uint32_t index) {
  const Patch patch = patches_[index];
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
  const auto added = static_cast<std::uint32_t>(patches_.size());
  patches_.push_back(patch);
  patches_[index].corner[a] = middle;
  patches_[added].corner[b] = middle;
  for (const std::uint32_t half : {index, added}) {
    patches_[half].seen = 0;  // another sphere may suit the smaller patch
    // The parent's bound holds for its parts too, whatever the search says.
    tighten(&patches_[half]);
    push(half);
  }
}

void SurfaceCover::certify(Packing* packing) {
  packing->spheres.clear();
  packing->spheres.reserve(spheres_.size());
  for (const MedialSphereFinder::InnerSphere& sphere : spheres_) {
    packing->spheres.push_back({sphere.center, sphere.radius, sphere.radius});
  }
  PackingCertificate& certificate = packing->certificate;
  double weighted = 0.0;
  for (Patch& patch : patches_) {
    tighten(&patch);
    InnerSphere& sphere = packing->spheres[patch.sphere];
    const double gap = std::max(0.0, patch.bound);
    sphere.cover_radius = std::max(sphere.cover_radius, sphere.radius + gap);
    certificate.max_gap = std::max(certificate.max_gap, gap);
    const double area =
        0.5 * (patch.corner[1] - patch.corner[0]).cross(patch.corner[2] - patch.corner[0]).norm();
    certificate.surface_area += area;
    weighted += area * gap;
    if (sphere.radius == 0.0) certificate.unreachable_area += area;
  }
  certificate.mean_gap = certificate.surface_area > 0.0 ? weighted / certificate.surface_area : 0.0;
}

}  // namespace ist
