#include "cloud/filters/zone_filter.h"

#include <algorithm>
#include <bitset>
#include <cmath>
#include <variant>

#include "internal/geometry/numbers.h"
#include "internal/geometry/relative_pose.h"

namespace ist {
namespace {

// Bound of the rounding of float coordinates, as a share of the numbers involved.
constexpr double kRoundedShare = 1e-6;

// [m] No point of a shape is farther from its origin.
double reach_of(const Shape& shape) {
  if (const Box* box = std::get_if<Box>(&shape)) return 0.5 * box->size.norm();
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) return sphere->radius;
  if (const Cylinder* cylinder = std::get_if<Cylinder>(&shape)) {
    return std::hypot(cylinder->radius, 0.5 * cylinder->length);
  }
  return 0.0;
}

}  // namespace

double depth_in(const Shape& shape, const Eigen::Vector3d& p_Z) {
  if (const Box* box = std::get_if<Box>(&shape)) {
    return (0.5 * box->size - p_Z.cwiseAbs()).minCoeff();
  }
  if (const Sphere* sphere = std::get_if<Sphere>(&shape)) return sphere->radius - p_Z.norm();
  if (const Cylinder* cylinder = std::get_if<Cylinder>(&shape)) {
    return std::min(cylinder->radius - p_Z.head<2>().norm(),
                    0.5 * cylinder->length - std::abs(p_Z.z()));
  }
  return -kInfinity;
}

void ZoneFilter::set_zones(const std::vector<Zone>& zones, std::size_t kept) {
  zones_.clear();
  for (const Zone& zone : zones) zones_.push_back({zone, Eigen::Isometry3d::Identity(), 0.0});
  kept_ = kept;
}

void ZoneFilter::begin_cloud(const Eigen::Isometry3d& X_FO, const PointExtent& extent) {
  extent_ = extent;
  p_OS_ = X_FO.inverse() * extent.p_FS;
  for (Placed& placed : zones_) {
    const Eigen::Isometry3d X_OZ = relative_pose(X_FO, placed.zone.X_FZ);
    placed.X_ZO = X_OZ.inverse();
    placed.rounding =
        kRoundedShare * (1.0 + X_OZ.translation().norm() + reach_of(placed.zone.shape));
  }
}

ZoneFilter::Verdict ZoneFilter::test(const PaddedBox& box) const {
  const Eigen::Vector3f center = 0.5F * (box.min + box.max).head<3>();
  return test(center.cast<double>(),
              0.5 * (1.0 + kRoundedShare) * static_cast<double>(box.diagonal()));
}

// The points of a sphere. The zones are in the order in which they count: of those before the one
// that decides, no point may be in one that would decide otherwise.
ZoneFilter::Verdict ZoneFilter::test(const Eigen::Vector3d& p_O, double radius) const {
  const double extent =
      extent_.is_zero() ? 0.0 : extent_.radius((p_O - p_OS_).norm() + radius + kRoundedShare);
  bool may_be_kept = false, may_be_left_out = false;
  for (const Placed& placed : zones_) {
    const double depth = depth_in(placed.zone.shape, placed.X_ZO * p_O);
    if (placed.zone.group == kept_) {
      if (depth < -radius - placed.rounding) continue;
      if (depth >= radius - placed.rounding && !may_be_left_out) return Verdict::kNone;
      may_be_kept = true;
      continue;
    }
    // A point is in another group's zone for certain, or not for certain.
    if (depth < extent + placed.rounding - radius) continue;
    if (depth >= extent + placed.rounding + radius && !may_be_kept) return Verdict::kAll;
    may_be_left_out = true;
  }
  if (kept_ == Zone::kNone) return may_be_left_out ? Verdict::kSome : Verdict::kNone;
  return may_be_kept ? Verdict::kSome : Verdict::kAll;
}

std::uint32_t ZoneFilter::points_left_out(const PointTile& tile) const {
  std::uint32_t mask = 0;
  for (int k = 0; k < tile.count; ++k) {
    const bool is_left_out = test(tile.point(k), 0.0) == Verdict::kAll;
    mask |= static_cast<std::uint32_t>(is_left_out) << static_cast<std::uint32_t>(k);
  }
  return mask;
}

std::uint32_t with_zones(const ZoneFilter& zones, const PointTile& tile, std::uint32_t dropped,
                         IngestCounts* counts) {
  const std::uint32_t in_zones = zones.points_left_out(tile) & ~dropped;
  counts->in_zones += static_cast<std::uint32_t>(std::bitset<32>(in_zones).count());
  return dropped | in_zones;
}

}  // namespace ist
