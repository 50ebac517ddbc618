#include "surface_cover.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "clearance_ascent.h"

namespace ist {
namespace {

// Gaps that candidates leave at the point they are made for, as shares of the gap there. Candidates
// that leave more are larger.
constexpr double kGapShares[] = {0.6, 0.33, 0.15};
// The share that a disjoint sphere may leave if it is the largest of its neighbourhood.
constexpr double kMaxGapShare = 0.9;
constexpr int kProgressInterval = 256;
// Searches for a sphere that no hole refuses.
constexpr int kMaxPlacements = 8;

// A patch gets a sphere if its sampled gap is at least this share of its upper bound; else it is
// split.
constexpr double kTight = 0.8;
// The same share, when no more spheres are added: how near the certificate is to the true gap.
constexpr double kCertificateTight = 0.95;
constexpr std::size_t kMaxCertificateSteps = 1000000;
// Patches that a packing may have besides its triangles: for each sphere that is allowed (a Panda's
// links need 12 to 52 at errors of 0.5 to 5 mm); at the least; and at the most, which is 1 GB.
constexpr std::size_t kPatchesPerSphere = 100, kMinPatches = 100000, kMaxPatches = 8000000;

}  // namespace

SurfaceCover::SurfaceCover(const TriangleMesh& mesh, const MedialSphereFinder& finder,
                           SphereSearch* search, PackingWatch* watch)
    : mesh_(mesh), finder_(finder), search_(*search), watch_(*watch) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& v : mesh.vertices) box.extend(v);
  min_edge_ = kMinPatchEdge * box.sizes().norm();
}

Eigen::Vector3d SurfaceCover::normal(std::uint32_t t) const {
  const Eigen::Vector3d n =
      (mesh_.corner(t, 1) - mesh_.corner(t, 0)).cross(mesh_.corner(t, 2) - mesh_.corner(t, 0));
  const double norm = n.norm();
  return norm > 0.0 ? Eigen::Vector3d(n / norm) : Eigen::Vector3d::Zero();
}

// Adds the largest sphere that fits, if its radius is at least `min_radius`.
bool SurfaceCover::fill(double min_radius, VolumeFiller* filler) {
  if (filler == nullptr) return false;
  const auto sphere = filler->next(min_radius);
  if (sphere) add_sphere(*sphere);
  return sphere.has_value();
}

// Searches again while holes refuse what is found; the last resort is the surface point s itself.
template <class Search>
MedialSphere SurfaceCover::admitted(const Eigen::Vector3d& s, const Search& search) const {
  for (int i = 0; i < kMaxPlacements && watch_.keeps_on(); ++i) {
    MedialSphere sphere = search();
    if (finder_.is_closed() || sphere.radius <= 0.0 || finder_.admits(sphere)) return sphere;
  }
  return {s, 0.0};
}

// The first sphere is the largest that fits, or touches the largest triangle.
void SurfaceCover::add_first_sphere(VolumeFiller* filler) {
  if (fill(0.0, filler)) return;
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
  const double gap = 1e3 * min_edge_;
  add_sphere(admitted(middle, [&] { return finder_.near_surface(middle, normal(largest), gap); }));
}

// Gives every triangle its sphere; false when it was stopped.
bool SurfaceCover::cover_triangles() {
  // Unused capacity costs no memory until it is touched; growing would hold all patches twice.
  patches_.reserve(2 * mesh_.triangles.size());
  heap_.reserve(2 * mesh_.triangles.size());
  for (std::uint32_t t = 0; t < mesh_.triangles.size(); ++t) {
    if (!watch_.keeps_on()) return false;
    Patch patch{{{mesh_.corner(t, 0), mesh_.corner(t, 1), mesh_.corner(t, 2)}}, 0.0, 0, 0, t};
    const SphereSearch::Match match = search_.best(patch.corner, 3, 0);
    patch.upper_bound = match.cost;
    patch.sphere = match.sphere;
    patch.accounted = static_cast<std::uint32_t>(spheres_.size());
    patches_.push_back(patch);
    heap_.push_back({patch.upper_bound, t});
  }
  std::make_heap(heap_.begin(), heap_.end(), UpperBoundLess());
  return true;
}

std::size_t SurfaceCover::max_patches(const TriangleMesh& mesh, const PackingConfig& config) {
  return 2 * mesh.triangles.size() +
         std::clamp(kPatchesPerSphere * static_cast<std::size_t>(config.max_spheres), kMinPatches,
                    kMaxPatches);
}

void SurfaceCover::add_sphere(const MedialSphere& sphere) {
  spheres_.push_back(sphere);
  search_.add(sphere.center, sphere.radius);
}

void SurfaceCover::push(std::uint32_t index) {
  heap_.push_back({patches_[index].upper_bound, index});
  std::push_heap(heap_.begin(), heap_.end(), UpperBoundLess());
}

// Takes the patch with the largest upper bound off the heap.
std::uint32_t SurfaceCover::pop() {
  std::pop_heap(heap_.begin(), heap_.end(), UpperBoundLess());
  const std::uint32_t patch = heap_.back().patch;
  heap_.pop_back();
  return patch;
}

// Accounts for the spheres added since the last time; true if one of them covers the patch better.
bool SurfaceCover::tighten(Patch* patch) const {
  const SphereSearch::Match match = search_.best(patch->corner, 3, patch->sphere, patch->accounted);
  patch->accounted = static_cast<std::uint32_t>(spheres_.size());
  if (match.cost >= patch->upper_bound) return false;
  patch->sphere = match.sphere;
  patch->upper_bound = match.cost;
  return true;
}

bool SurfaceCover::refine(const PackingConfig& config, VolumeFiller* filler) {
  add_first_sphere(filler);
  if (!cover_triangles()) return false;
  const std::size_t most = max_patches(mesh_, config);
  // In the order of volume, a sphere that fills a space always comes first. Else it does if its
  // radius is at least the largest bound.
  const double radius_share = config.order == PackingOrder::kVolume ? 0.0 : 1.0;
  double largest_bound = std::max(heap_.front().upper_bound, config.max_error);
  for (int step = 0; heap_.front().upper_bound > config.max_error; ++step) {
    if (step % kProgressInterval == 0) {
      // The number of spheres grows about with the inverse of the gap.
      largest_bound = std::min(largest_bound, heap_.front().upper_bound);
      watch_.report(std::min(1.0, config.max_error / largest_bound));
    }
    if (!watch_.keeps_on()) break;
    if (spheres_.size() >= static_cast<std::size_t>(config.max_spheres)) break;
    if (patches_.size() >= most) break;
    const std::uint32_t index = pop();
    Patch& patch = patches_[index];
    if (tighten(&patch) || fill(radius_share * patch.upper_bound, filler)) {
      push(index);
    } else {
      split_or_add_sphere(index, config.max_error);
    }
  }
  return true;
}

// The largest gap at some points of the patch: a lower bound of the patch's gap.
double SurfaceCover::sampled_gap(const Patch& patch, Eigen::Vector3d* worst_point) const {
  const Eigen::Vector3d middle = (patch.corner[0] + patch.corner[1] + patch.corner[2]) / 3.0;
  *worst_point = middle;
  double worst_gap = search_.best(&middle, 1, patch.sphere).cost;
  for (const Eigen::Vector3d& corner : patch.corner) {
    // Somewhat inside the patch: a corner also belongs to faces with other normals.
    const Eigen::Vector3d point = 0.98 * corner + 0.02 * middle;
    const double gap = search_.best(&point, 1, patch.sphere, 0, worst_gap).cost;
    if (gap > worst_gap) {
      worst_gap = gap;
      *worst_point = point;
    }
  }
  return worst_gap;
}

void SurfaceCover::split_or_add_sphere(std::uint32_t index, double max_error) {
  const Patch& patch = patches_[index];
  Eigen::Vector3d worst_point;
  const double worst_gap = sampled_gap(patch, &worst_point);
  if (worst_gap < std::max(kTight * patch.upper_bound, 0.98 * max_error) &&
      patch.longest_edge() > min_edge_) {
    split(index);
    return;
  }
  const double gap = std::max(std::min(worst_gap, patch.upper_bound), 0.5 * max_error);
  const std::uint32_t triangle = patch.triangle;
  add_sphere(admitted(worst_point, [&] { return candidate(worst_point, triangle, gap); }));
  push(index);
}

// A sphere that closes the gap at the surface point s and covers much of the surface about it. On a
// flat face, the area that it covers to within the gap grows with its radius and with the part of
// the gap that it closes. The square of that part serves better where faces end.
MedialSphere SurfaceCover::candidate(const Eigen::Vector3d& s, std::uint32_t triangle,
                                     double gap) const {
  const auto distance = [&s](const MedialSphere& sphere) {
    return (sphere.center - s).norm() - sphere.radius;
  };
  MedialSphere best{s, 0.0};
  double best_score = 0.0;
  for (const double share : kGapShares) {
    if (finder_.is_disjoint() && best.radius > 0.0) break;  // it is a start to climb from
    const MedialSphere sphere = finder_.near_surface(s, normal(triangle), share * gap);
    const double closed = std::max(0.0, gap - distance(sphere));
    const double score = sphere.radius * closed * closed;
    if (score <= best_score) continue;
    best_score = score;
    best = sphere;
  }
  if (!finder_.is_disjoint() || best.radius <= 0.0) return best;
  const MedialSphere largest = climb_clearance(finder_, best.center);
  return distance(largest) <= kMaxGapShare * gap ? largest : best;
}

void SurfaceCover::tighten_certificate(const PackingConfig& config) {
  const std::size_t most = max_patches(mesh_, config);
  double lower_bound = 0.0;  // [m] of the largest gap
  for (std::size_t i = 0; i < kMaxCertificateSteps && patches_.size() < most; ++i) {
    if (!watch_.keeps_on()) return;
    const std::uint32_t index = pop();
    Patch& patch = patches_[index];
    if (tighten(&patch)) {
      push(index);
      continue;
    }
    Eigen::Vector3d worst_point;
    lower_bound = std::max(lower_bound, sampled_gap(patch, &worst_point));
    const bool is_tight = kCertificateTight * patch.upper_bound <= lower_bound;
    if (is_tight || patch.longest_edge() <= min_edge_) {
      push(index);
      return;
    }
    split(index);
  }
}

// Two patches that cover the old one without overlap take its place.
void SurfaceCover::split(std::uint32_t index) {
  const auto added = static_cast<std::uint32_t>(patches_.size());
  patches_.push_back(patches_[index]);
  static_cast<SurfacePatch&>(patches_[added]) = patches_[index].split_off_half();
  for (const std::uint32_t half : {index, added}) {
    patches_[half].accounted = 0;  // another sphere may cover the smaller patch better
    // The old patch's bound holds for its parts, too, whatever the search finds.
    tighten(&patches_[half]);
    push(half);
  }
}

void SurfaceCover::certify(Packing* packing) {
  packing->spheres.clear();
  packing->spheres.reserve(spheres_.size());
  for (const MedialSphere& sphere : spheres_) {
    packing->spheres.push_back({sphere.center, sphere.radius, sphere.radius});
  }
  PackingCertificate& certificate = packing->certificate;
  double weighted = 0.0;
  for (Patch& patch : patches_) {
    if (watch_.keeps_on()) tighten(&patch);  // the old bound holds, too
    InnerSphere& sphere = packing->spheres[patch.sphere];
    const double gap = std::max(0.0, patch.upper_bound);
    sphere.cover_radius = std::max(sphere.cover_radius, sphere.radius + gap);
    certificate.max_gap = std::max(certificate.max_gap, gap);
    const double area = patch.area();
    certificate.surface_area += area;
    weighted += area * gap;
    if (sphere.radius == 0.0) certificate.unreachable_area += area;
  }
  certificate.mean_gap = certificate.surface_area > 0.0 ? weighted / certificate.surface_area : 0.0;
}

}  // namespace ist
