#include "volume_filler.h"

#include <algorithm>
#include <cmath>

#include "clearance_climb.h"

namespace ist {
namespace {

// A prototype is taken when nothing can be larger than it by more than this.
constexpr double kEnough = 0.9;
// A prototype starts where the cell is small against the clearance: a finer start climbs no higher.
constexpr double kClimbAt = 0.5;
// Steps of a search between two questions whether to go on.
constexpr std::uint32_t kStopInterval = 64;
// Refusals by holes, of one prototype and in all: a mesh that is nothing but holes has no more
// room.
constexpr int kMaxRefusals = 2;
constexpr int kMaxRefusalsInAll = 500;

}  // namespace

VolumeFiller::VolumeFiller(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                           const SphereSearch& spheres, double min_radius)
    : bvh_(bvh), finder_(finder), spheres_(spheres), min_radius_(min_radius) {
  const Eigen::AlignedBox3d box = bvh.bounds();
  const double half = 0.25 * box.sizes().maxCoeff();
  if (box.sizes().minCoeff() <= 0.0) return;  // flat: nothing to fill
  for (int corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d sign((corner & 1) - 0.5, ((corner >> 1) & 1) - 0.5,
                               ((corner >> 2) & 1) - 0.5);
    add_cell(box.center() + 2.0 * half * sign, half, nullptr);
  }
}

void VolumeFiller::add_cell(const Eigen::Vector3d& center, double half, const Cell* parent) {
  const double radius = std::sqrt(3.0) * half;
  const double to_surface = std::sqrt(bvh_.closest(center).distance_sq);
  // Within the sphere about the parent's centre that no triangle enters, the side is the same.
  const bool same_side = parent != nullptr && finder_.is_closed() &&
                         std::abs(parent->room) > (center - parent->center).norm();
  const bool inside = same_side ? parent->room > 0.0 : bvh_.is_inside(center);
  // Spheres keep as far away from a point outside as the mesh, on the other side of a hole too.
  const double room = inside ? finder_.holes().nearest(center, to_surface).distance : -to_surface;
  Cell cell{center, half, room, room, room + radius, 0, false};
  update(&cell);
  if (cell.bound < min_radius_) return;
  cells_.push_back(cell);
  std::push_heap(cells_.begin(), cells_.end(), BoundLess());
}

// Spheres added since; true if they lower the bound.
bool VolumeFiller::update(Cell* cell) const {
  if (cell->seen == count()) return false;
  const SphereSearch::Match match = spheres_.best(&cell->center, 1, count() - 1, cell->seen);
  cell->seen = count();
  cell->clearance = std::min(cell->clearance, match.cost);
  const double bound = match.cost + std::sqrt(3.0) * cell->half;
  if (bound >= cell->bound) return false;
  cell->bound = bound;
  return true;
}

void VolumeFiller::add_prototype(const Eigen::Vector3d& start, int refusals) {
  const MedialSphereFinder::InnerSphere sphere = climb(finder_, start);
  // A little below min_radius too: what is left of a cell must be decided before its size is 0.
  if (sphere.radius < kEnough * min_radius_ || sphere.radius <= 0.0) return;
  prototypes_.push_back({sphere, count(), refusals});
  std::push_heap(prototypes_.begin(), prototypes_.end(), Smaller());
}

// The largest prototype is clear of all spheres afterwards. One that a new sphere cuts into climbs
// anew from where it is.
void VolumeFiller::revise_prototypes() {
  while (!prototypes_.empty() && prototypes_.front().seen != count()) {
    std::pop_heap(prototypes_.begin(), prototypes_.end(), Smaller());
    Prototype prototype = prototypes_.back();
    prototypes_.pop_back();
    const double clear =
        spheres_.best(&prototype.sphere.center, 1, count() - 1, prototype.seen).cost;
    if (clear >= prototype.sphere.radius) {
      prototype.seen = count();
      prototypes_.push_back(prototype);
      std::push_heap(prototypes_.begin(), prototypes_.end(), Smaller());
    } else if (clear > 0.0) {
      add_prototype(prototype.sphere.center, prototype.refusals);
    }
  }
}

bool VolumeFiller::is_stopped() {
  if (!stopped_ && ++steps_ % kStopInterval == 0 && progress_) stopped_ = !progress_(0.0);
  return stopped_;
}

std::optional<MedialSphereFinder::InnerSphere> VolumeFiller::next(double at_least) {
  for (;;) {
    if (is_stopped()) return std::nullopt;
    revise_prototypes();
    const double found = prototypes_.empty() ? 0.0 : prototypes_.front().sphere.radius;
    if (cells_.empty() || cells_.front().bound <= std::max(found / kEnough, at_least)) {
      if (found <= 0.0 || found < kEnough * at_least) return std::nullopt;
      std::pop_heap(prototypes_.begin(), prototypes_.end(), Smaller());
      const Prototype prototype = prototypes_.back();
      prototypes_.pop_back();
      const MedialSphereFinder::InnerSphere& sphere = prototype.sphere;
      if (finder_.is_closed() || finder_.admits(sphere)) return sphere;
      stopped_ = ++refusals_ >= kMaxRefusalsInAll;
      // It climbs anew from where it is, away from the hole, but not without end.
      if (prototype.refusals < kMaxRefusals && finder_.nearest(sphere.center).distance > 0.0) {
        add_prototype(sphere.center, prototype.refusals + 1);
      }
      continue;
    }
    std::pop_heap(cells_.begin(), cells_.end(), BoundLess());
    Cell cell = cells_.back();
    cells_.pop_back();
    const bool is_stale = update(&cell);
    if (!is_stale && !cell.has_climbed && cell.half <= kClimbAt * cell.clearance) {
      cell.has_climbed = true;
      add_prototype(cell.center);
    } else if (!is_stale) {
      for (int corner = 0; corner < 8; ++corner) {
        const Eigen::Vector3d sign((corner & 1) - 0.5, ((corner >> 1) & 1) - 0.5,
                                   ((corner >> 2) & 1) - 0.5);
        add_cell(cell.center + cell.half * sign, 0.5 * cell.half, &cell);
      }
      continue;
    }
    if (cell.bound < min_radius_) continue;
    cells_.push_back(cell);
    std::push_heap(cells_.begin(), cells_.end(), BoundLess());
  }
}

}  // namespace ist
