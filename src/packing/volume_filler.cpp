#include "volume_filler.h"

#include <algorithm>
#include <cmath>

#include "clearance_ascent.h"

namespace ist {
namespace {

// A prototype is taken when its radius is this share of the largest upper bound.
constexpr double kEnough = 0.9;
// A prototype starts where the cell is small against the clearance: a finer start climbs no higher.
constexpr double kStartSize = 0.5;
// Prototypes refused because of holes, one by one and in all. A mesh that is nothing but holes has
// no interior to fill.
constexpr int kMaxRefusals = 2;
constexpr int kMaxRefusalsInAll = 500;

}  // namespace

VolumeFiller::VolumeFiller(const TriangleBvh& bvh, const MedialSphereFinder& finder,
                           const SphereSearch& spheres, double min_radius)
    : bvh_(bvh), finder_(finder), spheres_(spheres), min_radius_(min_radius) {
  const Eigen::AlignedBox3d& box = bvh.bounds();
  if (box.sizes().minCoeff() <= 0.0) return;  // flat: nothing to fill
  divide(box.center(), 0.5 * box.sizes().maxCoeff(), nullptr);
}

// Replaces a cube by its octants.
void VolumeFiller::divide(const Eigen::Vector3d& center, double half, const Cell* parent) {
  for (int octant = 0; octant < 8; ++octant) {
    const Eigen::Vector3d half_signs((octant & 1) - 0.5, ((octant >> 1) & 1) - 0.5,
                                     ((octant >> 2) & 1) - 0.5);
    add_cell(center + half * half_signs, 0.5 * half, parent);
  }
}

void VolumeFiller::add_cell(const Eigen::Vector3d& center, double half, const Cell* parent) {
  const double circumradius = std::sqrt(3.0) * half;
  const double distance = std::sqrt(bvh_.closest(center).distance_sq);
  // No triangle enters the parent's clearance sphere: all its points are on the same side.
  const bool same_side = parent != nullptr && finder_.is_closed() &&
                         std::abs(parent->mesh_clearance) > (center - parent->center).norm();
  const bool inside = same_side ? parent->mesh_clearance > 0.0 : bvh_.is_inside(center);
  const double clearance = inside ? finder_.holes().nearest(center, distance).distance : -distance;
  Cell cell{center, half, clearance, clearance, clearance + circumradius, 0, false};
  tighten(&cell);
  push(cell);
}

// Cells in which only spheres below the least radius fit are dropped.
void VolumeFiller::push(const Cell& cell) {
  if (cell.upper_bound < min_radius_) return;
  cells_.push_back(cell);
  std::push_heap(cells_.begin(), cells_.end(), UpperBoundLess());
}

void VolumeFiller::push(const Prototype& prototype) {
  prototypes_.push_back(prototype);
  std::push_heap(prototypes_.begin(), prototypes_.end(), RadiusLess());
}

VolumeFiller::Cell VolumeFiller::pop_cell() {
  std::pop_heap(cells_.begin(), cells_.end(), UpperBoundLess());
  Cell cell = cells_.back();
  cells_.pop_back();
  return cell;
}

VolumeFiller::Prototype VolumeFiller::pop_prototype() {
  std::pop_heap(prototypes_.begin(), prototypes_.end(), RadiusLess());
  Prototype prototype = prototypes_.back();
  prototypes_.pop_back();
  return prototype;
}

// Accounts for the spheres added since the last time; true if they lower the upper bound.
bool VolumeFiller::tighten(Cell* cell) const {
  if (cell->accounted == sphere_count()) return false;
  const SphereSearch::Match match =
      spheres_.best(&cell->center, 1, sphere_count() - 1, cell->accounted);
  cell->accounted = sphere_count();
  cell->clearance = std::min(cell->clearance, match.cost);
  const double upper_bound = match.cost + std::sqrt(3.0) * cell->half;
  if (upper_bound >= cell->upper_bound) return false;
  cell->upper_bound = upper_bound;
  return true;
}

// One step of the branch and bound: the cell with the largest upper bound gets a tighter bound,
// starts a prototype or is divided.
void VolumeFiller::refine_best_cell() {
  Cell cell = pop_cell();
  const bool is_tighter = tighten(&cell);
  if (!is_tighter && (cell.has_climbed || cell.half > kStartSize * cell.clearance)) {
    divide(cell.center, cell.half, &cell);
    return;
  }
  if (!is_tighter) {
    cell.has_climbed = true;
    add_prototype(cell.center);
  }
  push(cell);
}

void VolumeFiller::add_prototype(const Eigen::Vector3d& start, int refusals) {
  const MedialSphere sphere = climb_clearance(finder_, start);
  // Somewhat smaller ones than min_radius, too: a cell must be decided before its size is 0.
  if (sphere.radius < kEnough * min_radius_ || sphere.radius <= 0.0) return;
  push({sphere, sphere_count(), refusals});
}

// Makes the largest prototype clear of all spheres. A prototype that a new sphere overlaps climbs
// again from where it is.
void VolumeFiller::revise_prototypes() {
  while (!prototypes_.empty() && prototypes_.front().accounted != sphere_count()) {
    Prototype prototype = pop_prototype();
    const Eigen::Vector3d& center = prototype.sphere.center;
    const double clearance =
        spheres_.best(&center, 1, sphere_count() - 1, prototype.accounted).cost;
    if (clearance >= prototype.sphere.radius) {
      prototype.accounted = sphere_count();
      push(prototype);
    } else if (clearance > 0.0) {
      add_prototype(center, prototype.refusals);
    }
  }
}

// Returns the largest prototype, unless it comes too near to a hole. Then it climbs again from
// where it is, away from the hole, but only a few times.
std::optional<MedialSphere> VolumeFiller::take_prototype() {
  const Prototype prototype = pop_prototype();
  const MedialSphere& sphere = prototype.sphere;
  if (finder_.is_closed() || finder_.admits(sphere)) return sphere;
  stopped_ = ++refusals_ >= kMaxRefusalsInAll;
  if (prototype.refusals < kMaxRefusals && finder_.nearest(sphere.center).distance > 0.0) {
    add_prototype(sphere.center, prototype.refusals + 1);
  }
  return std::nullopt;
}

bool VolumeFiller::is_stopped() {
  stopped_ = stopped_ || cells_.size() > kMaxCells || !finder_.holes().keeps_on();
  return stopped_;
}

std::optional<MedialSphere> VolumeFiller::next(double at_least) {
  while (!is_stopped()) {
    revise_prototypes();
    const double found = prototypes_.empty() ? 0.0 : prototypes_.front().sphere.radius;
    const double upper_bound = cells_.empty() ? 0.0 : cells_.front().upper_bound;
    if (!cells_.empty() && upper_bound > std::max(found / kEnough, at_least)) {
      refine_best_cell();
      continue;
    }
    if (found <= 0.0 || found < kEnough * at_least) return std::nullopt;
    if (auto sphere = take_prototype()) return sphere;
  }
  return std::nullopt;
}

}  // namespace ist
