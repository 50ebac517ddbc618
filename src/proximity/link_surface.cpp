#include "proximity/link_surface.h"

#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <mutex>
#include <numeric>
#include <tuple>

#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

using Place = std::tuple<double, double, double>;

// Union and find over the corners of triangles; corners at the same place are one.
class Components {
 public:
  std::size_t corner(const Eigen::Vector3d& p) {
    const auto [found, is_new] = corners_.try_emplace({p.x(), p.y(), p.z()}, parent_.size());
    if (is_new) {
      parent_.push_back(parent_.size());
      points_.push_back(p);
    }
    return found->second;
  }
  void join(std::size_t a, std::size_t b) { parent_[root(a)] = root(b); }

  void append_points(std::vector<Eigen::Vector3d>* points) {
    for (std::size_t i = 0; i < parent_.size(); ++i) {
      if (root(i) == i) points->push_back(points_[i]);
    }
  }

 private:
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  std::map<Place, std::size_t> corners_;
  std::vector<std::size_t> parent_;
  std::vector<Eigen::Vector3d> points_;
};

std::vector<Eigen::Vector3d> points_of_components(const SurfaceBvh& surface,
                                                  const CancelRequest& cancelled) {
  CancelWatch watch(cancelled);
  std::vector<Eigen::Vector3d> points;
  Components components;
  for (const ConvexPart& part : surface.parts()) {
    watch.step();
    if (part.kind != ConvexPart::Kind::kTriangle) {
      points.push_back(part.a);
      continue;
    }
    const std::size_t a = components.corner(part.a);
    components.join(a, components.corner(part.b));
    components.join(a, components.corner(part.c));
  }
  components.append_points(&points);
  return points;
}

// The sphere of an inside point's depth holds no surface. In a closed link it lies in the box about
// the link; an open link holds no point that is farther from its cover spheres than the interior
// gap.
double depth_limit_of(const LinkModel& link, const SurfaceBvh& surface) {
  if (surface.empty()) return 0.0;
  if (!link.solid.is_closed()) return 2.0 * link.tree.radius() + link.tree.interior_gap();
  return 0.5 * surface.bounds().sizes().minCoeff();
}

double opening_margin_of(const SurfaceBvh& surface, const SurfaceBvh& cells,
                         const CancelRequest& cancelled) {
  CancelWatch watch(cancelled);
  if (cells.empty()) return 0.0;
  if (surface.hull().empty()) return std::numeric_limits<double>::infinity();
  double margin = 0.0;
  for (const ConvexPart& cell : cells.parts()) {
    watch.step();
    margin = std::max(margin, surface.hull().distance_at_most(cell.a) + cell.radius);
  }
  return margin;
}

Eigen::AlignedBox3d box_of(const LinkModel& link, const SurfaceBvh& surface,
                           const SurfaceBvh& cells) {
  Eigen::AlignedBox3d box = bounding_box(link);
  for (const SurfaceBvh* bvh : {&surface, &cells}) {
    if (!bvh->empty()) box.extend(bvh->bounds());
  }
  return box;
}

}  // namespace

LinkSurface::LinkSurface(const LinkModel& link, const CancelRequest& cancelled)
    : solid(link.solid),
      surface(link.solid, cancelled),
      openings(link.solid, cancelled),
      opening_cells(openings.cells(), cancelled),
      opening_margin(opening_margin_of(surface, opening_cells, cancelled)),
      component_points(points_of_components(surface, cancelled)),
      box(box_of(link, surface, opening_cells)),
      displacement(box),
      depth_limit(depth_limit_of(link, surface)) {}

std::shared_ptr<const LinkSurface> LinkSurface::of(const LinkModel& link,
                                                   const CancelRequest& cancelled) {
  static std::mutex mutex;
  static std::vector<std::weak_ptr<const LinkSurface>> in_use;
  const std::lock_guard<std::mutex> lock(mutex);  // two threads would make the same one
  in_use.erase(std::remove_if(in_use.begin(), in_use.end(),
                              [](const auto& other) { return other.expired(); }),
               in_use.end());
  for (const auto& kept : in_use) {
    auto same = kept.lock();
    if (same && is_same_solid(same->solid, link.solid)) return same;
  }
  auto made = std::make_shared<const LinkSurface>(link, cancelled);
  in_use.push_back(made);
  return made;
}

}  // namespace ist
