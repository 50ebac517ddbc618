#include "proximity/signed_distance_grid.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/outside_margin.h"
#include "proximity/coherence/displacement.h"

namespace ist {
namespace {

// Relative error of a stored value.
constexpr double kStored = 1e-6;
// [m] More than double loses in the distance of two places of a link.
constexpr double kRounding = 1e-12;
// Cells along the radius of a link. A mesh with holes has more of them, because what is outside
// about a cell's centre ends where an open edge is near.
constexpr double kCellsPerRadius = 16.0, kCellsPerRadiusWithHoles = 24.0;
constexpr double kMinCell = 1e-3;  // [m]
// Cells to either side of the origin that a key can tell apart.
constexpr double kMaxIndex = 262143.0;
// [m] What the error of a plane may be at the end of a cell, about, where the link is convex.
constexpr double kPlaneError = 1e-3;
// The radius in which a cell's plane holds, in edges of a cell: half a diagonal is 0.87.
constexpr double kPlaneRadius = 1.5;
// Cells farther from the surface than so many of these radii have no plane.
constexpr double kPlaneDistance = 64.0;
// The share of that radius by which a plane may be too high.
constexpr double kPlaneTolerance = 0.01;
// A plane that cuts off less of the sphere about C, as a share of its radius, says little. Below
// this one, a place in the plane's radius, which is half the sphere's at most, gets straight up to
// the plane without leaving the sphere.
constexpr double kHighestPlane = 0.86;

}  // namespace

SignedDistanceGrid::SignedDistanceGrid(const LinkModel& link)
    : solid_(&link.solid),
      is_one_mesh_(is_one_mesh(link.solid)),
      is_closed_(link.solid.is_closed()),
      origin_(link.tree.center()),
      size_(std::max(link.tree.radius() / (is_closed_ ? kCellsPerRadius : kCellsPerRadiusWithHoles),
                     kMinCell)),
      per_size_(1.0 / size_),
      cells_(kCells) {}

double SignedDistanceGrid::plane_radius(int level) const { return kPlaneRadius * size(level); }

// A place at distance d from a point has an error of t^2 / 2d at t across the plane's normal.
void SignedDistanceGrid::set_distance(double distance) {
  const double wanted = std::sqrt(2.0 * kPlaneError * std::max(distance, 0.0));
  level_ = 0;
  while (level_ < kMaxLevel && size(level_ + 1) <= wanted) ++level_;
  per_size_ = 1.0 / size(level_);
}

// Written so that NaN has no key.
std::uint64_t SignedDistanceGrid::key(const Eigen::Vector3d& p_LQ) const {
  const Eigen::Array3d at = (per_size_ * (p_LQ - origin_)).array();
  auto key = static_cast<std::uint64_t>(level_ + 1);
  for (int axis = 0; axis < 3; ++axis) {
    if (!(std::abs(at[axis]) < kMaxIndex)) return 0;
    key = key << kIndexBits | static_cast<std::uint64_t>(std::floor(at[axis]) + kMaxIndex + 1.0);
  }
  return key;
}

Eigen::Vector3d SignedDistanceGrid::center(const Cell& cell) const {
  constexpr std::uint64_t kIndexMask = (std::uint64_t{1} << kIndexBits) - 1;
  Eigen::Array3d index;
  for (unsigned axis = 0; axis < 3; ++axis) {
    const std::uint64_t bits = cell.key >> ((2 - axis) * kIndexBits) & kIndexMask;
    index[axis] = static_cast<double>(static_cast<std::int64_t>(bits)) - (kMaxIndex + 0.5);
  }
  return origin_ + size(level(cell)) * index.matrix();
}

SignedDistanceGrid::Cell* SignedDistanceGrid::find(const Eigen::Vector3d& p_LQ) {
  const std::uint64_t wanted = key(p_LQ);
  Cell& cell = cells_[slot(wanted)];
  return wanted != 0 && cell.key == wanted ? &cell : nullptr;
}

SignedDistanceGrid::Cell* SignedDistanceGrid::measure(const Eigen::Vector3d& p_LQ) {
  const std::uint64_t wanted = key(p_LQ);
  if (wanted == 0) return nullptr;
  Cell& cell = cells_[slot(wanted)];
  if (cell.key != wanted) {
    cell = Cell();
    cell.key = wanted;
    fill(&cell);
  }
  return &cell;
}

// The cells that share a face with a cell. Those that have been measured bound it.
template <class Visit>
void SignedDistanceGrid::for_each_neighbor(std::uint64_t key, const Visit& visit) const {
  for (unsigned axis = 0; axis < 3; ++axis) {
    const std::uint64_t step = std::uint64_t{1} << (axis * kIndexBits);
    for (const std::uint64_t neighbor : {key - step, key + step}) {
      const Cell& cell = cells_[slot(neighbor)];
      if (cell.key == neighbor) visit(cell);
    }
  }
}

NearSurface SignedDistanceGrid::known_by_neighbors(const Cell& cell,
                                                   const Eigen::Vector3d& center) const {
  NearSurface known;
  if (!is_one_mesh_) return known;
  for_each_neighbor(cell.key, [&](const Cell& neighbor) {
    known.within = std::min(known.within, -depth_bound(neighbor, {center}));
    const auto floor = static_cast<double>(neighbor.floor);
    const double distance = (center - this->center(neighbor)).norm() + kRounding;
    if (is_closed_ && distance < (1.0 - kStored) * std::abs(floor)) {
      known.side = floor < 0.0 ? NearSurface::Side::kInside : NearSurface::Side::kOutside;
    }
  });
  return known;
}

void SignedDistanceGrid::fill(Cell* cell) const {
  const Eigen::Vector3d center = this->center(*cell);
  NearSurface known = known_by_neighbors(*cell, center);
  // A mesh with holes has no side that a bound could use.
  const bool has_holes = is_one_mesh_ && !is_closed_;
  if (has_holes) known.side = NearSurface::Side::kOutside;
  const PointDepth depth = point_depth(*solid_, center, -1.0, known);
  cell->floor = round_down(depth.floor);
  cell->triangle = depth.triangle;
  cell->normal = depth.exact.normal.cast<float>();
  if (has_holes && depth.triangle != kNoTriangle &&
      is_behind_triangle(*solid_, depth.triangle, center)) {
    cell->normal = -cell->normal;
  }
  cell->witness =
      round_down(cell->normal.cast<double>().dot(depth.exact.witness - center) - kRounding);
  // Far from the link, or without a surface, a plane bounds no better than the distance.
  cell->has_plane = !(std::abs(depth.exact.distance) < kPlaneDistance * plane_radius(level(*cell)));
}

// The surface that is closest to any place in the plane's radius is within two of them and the
// distance of C.
void SignedDistanceGrid::find_plane(Cell* cell) const {
  cell->has_plane = true;
  const Eigen::Vector3d center = this->center(*cell);
  const auto floor = static_cast<double>(cell->floor);
  const double plane_radius = this->plane_radius(level(*cell));
  const double radius = (1.0 + kStored) * std::abs(floor) + 2.0 * plane_radius + kRounding;
  const Eigen::Vector3d normal = cell->normal.cast<double>();
  const double plane = surface_support_in_sphere(*solid_, center, radius, normal,
                                                 kPlaneTolerance * plane_radius, cell->witness) +
                       kStored * radius;
  if (!(plane < kHighestPlane * radius)) return;
  cell->plane = round_up(plane);
  // No surface is in the part of the sphere above the plane: one place is outside if all are.
  const double place = 0.5 * (std::max(plane, 0.0) + radius);
  cell->is_outside_above_plane = is_closed_ && !solid_->is_inside(center + place * normal);
}

double SignedDistanceGrid::Part::extent_against(const Eigen::Vector3d& n_L) const {
  if (R_LO == nullptr) return radius * n_L.norm();
  const Eigen::Vector3d n_O = R_LO->transpose() * n_L;
  if (points == nullptr) return n_O.cwiseAbs().dot(half);
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kPointWidth; ++k) {  // so many, for SIMD
    const double along = n_O.x() * static_cast<double>(points->x[k]) +
                         n_O.y() * static_cast<double>(points->y[k]) +
                         n_O.z() * static_cast<double>(points->z[k]);
    least = k < points->count && along < least ? along : least;
  }
  return n_O.dot(center_O) - least;
}

double SignedDistanceGrid::Part::reach_from(const Eigen::Vector3d& p_LA) const {
  const Eigen::Vector3d from_A = center_L - p_LA;
  if (R_LO == nullptr) return from_A.norm() + radius;
  const Eigen::Vector3d from_A_O = R_LO->transpose() * from_A;
  if (points == nullptr) return (from_A_O.cwiseAbs() + half).norm();
  const Eigen::Vector3d p_OA = center_O - from_A_O;
  double farthest_sq = 0.0;
  for (int k = 0; k < kPointWidth; ++k) {  // so many, for SIMD
    const double x = static_cast<double>(points->x[k]) - p_OA.x(),
                 y = static_cast<double>(points->y[k]) - p_OA.y(),
                 z = static_cast<double>(points->z[k]) - p_OA.z();
    const double distance_sq = x * x + y * y + z * z;
    farthest_sq = k < points->count && distance_sq > farthest_sq ? distance_sq : farthest_sq;
  }
  return std::sqrt(farthest_sq);
}

double SignedDistanceGrid::floor_bound(const Cell& cell, const Eigen::Vector3d& center_L,
                                       double radius) const {
  return static_cast<double>(cell.floor) - (center_L - center(cell)).norm() - radius - kRounding;
}

SignedDistanceGrid::Bound SignedDistanceGrid::bound(Cell* cell, const Part& part,
                                                    double enough) const {
  const Eigen::Vector3d from_C = part.center_L - center(*cell);
  const double distance = from_C.norm() + part.radius + kRounding;
  const auto floor = static_cast<double>(cell->floor);
  Bound bound;
  bound.signed_distance = floor - distance;
  if (is_one_mesh_ || floor > 0.0) {
    bound.surface_distance = std::max((1.0 - kStored) * std::abs(floor) - distance, 0.0);
  }
  bound.is_outside = is_closed_ && bound.signed_distance > 0.0;
  const double by_floor = is_closed_ ? bound.signed_distance : bound.surface_distance;
  if (distance > plane_radius(level(*cell)) || by_floor >= enough) return bound;
  if (!cell->has_plane) find_plane(cell);
  const Eigen::Vector3d normal = cell->normal.cast<double>();
  const double above = normal.dot(from_C) - part.extent_against(normal) -
                       static_cast<double>(cell->plane) - kStored * distance;
  if (above > 0.0) {
    bound.surface_distance = std::max(bound.surface_distance, above);
    bound.is_outside = bound.is_outside || cell->is_outside_above_plane;
  }
  // A place inside and below the plane meets the surface on its way up.
  if (cell->is_outside_above_plane) {
    bound.signed_distance = std::max(bound.signed_distance, above);
  }
  return bound;
}

// No surface is within C's distance of C, nor within the part's of its places. Where these spheres
// overlap, a straight line from C to a place of the part crosses no surface, and a line from there
// that is shorter than the part's distance does not either.
double SignedDistanceGrid::outside_margin(Cell* cell, const Part& part) const {
  if (is_closed_ || !is_one_mesh_) return 0.0;
  // The closest point is against the outward normal of a place outside.
  if (!cell->has_margin && !(cell->witness < 0.0F)) return 0.0;
  const Eigen::Vector3d center = this->center(*cell);
  const double reach = (part.center_L - center).norm() + part.radius + kRounding;
  const double edge = size(level(*cell));
  if (cell->has_margin && reach >= cell->margin * edge / kMarginParts) return 0.0;
  const double distance = (1.0 - kStored) * std::abs(static_cast<double>(cell->floor));
  const double part_distance =
      bound(cell, part, std::numeric_limits<double>::infinity()).surface_distance;
  if (!(reach < distance + part_distance)) return 0.0;
  if (!cell->has_margin) {
    cell->has_margin = true;
    const double most = 255.0 * edge / kMarginParts;
    const double parts = kMarginParts * ist::outside_margin(*solid_, center, most).margin / edge;
    cell->margin = static_cast<std::uint8_t>(std::min(parts, 255.0));
  }
  return std::min(part_distance, cell->margin * edge / kMarginParts * (1.0 - kStored) - reach);
}

// The surface is no farther from any place of the part than a point of the triangle is.
double SignedDistanceGrid::depth_bound(const Cell& cell, const Part& part) const {
  if (cell.triangle == kNoTriangle) return -std::numeric_limits<double>::infinity();
  const Eigen::Vector3d p_LT = closest_on_triangle(*solid_, cell.triangle, part.center_L);
  return -(1.0 + kStored) * part.reach_from(p_LT) - kRounding;
}

NearSurface SignedDistanceGrid::near_surface(Cell* cell, const Eigen::Vector3d& p_LQ) const {
  NearSurface near;
  if (!is_one_mesh_) return near;
  const double distance = (p_LQ - center(*cell)).norm() + kRounding;
  const auto floor = static_cast<double>(cell->floor);
  near.within = std::min((1.0 + kStored) * std::abs(floor) + distance, -depth_bound(*cell, {p_LQ}));
  if (bound(cell, {p_LQ}, std::numeric_limits<double>::infinity()).is_outside) {
    near.side = NearSurface::Side::kOutside;
  } else if (is_closed_ && floor < 0.0 && distance < (1.0 - kStored) * -floor) {
    near.side = NearSurface::Side::kInside;
  }
  return near;
}

}  // namespace ist
