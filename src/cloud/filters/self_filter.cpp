#include "cloud/filters/self_filter.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "cloud/filters/field_verdict_kernel.h"
#include "internal/geometry/distance_field.h"
#include "internal/geometry/relative_pose.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// Bound of the rounding of float coordinates and radii, as a share of the numbers involved.
constexpr double kRounding = 1e-6;

std::uint32_t all_of(const PointTile& tile) {
  return (1U << static_cast<std::uint32_t>(tile.count)) - 1U;
}

// Bit k: the id of the point in slot k is one of [first, last].
std::uint32_t slots_within(const PointTile& tile, std::uint32_t first, std::uint32_t last) {
  std::uint32_t mask = 0;
  for (std::int32_t k = 0; k < tile.count; ++k) {
    const bool is_within = tile.id[k] >= first && tile.id[k] <= last;
    mask |= static_cast<std::uint32_t>(is_within) << static_cast<std::uint32_t>(k);
  }
  return mask;
}

}  // namespace

void SelfFilter::set_poses(Span<const PosedSolid> solids, const Eigen::Isometry3d& X_FO,
                           double padding, Span<const double> own) {
  links_.clear();
  group_.clear();
  undecided_.clear();
  for (std::size_t i = 0; i < solids.size(); ++i) {
    const PosedSolid& posed = solids[i];
    const InnerSphereTree& tree = *posed.tree;
    if (tree.empty()) continue;
    const Eigen::Isometry3d X_OL = relative_pose(X_FO, posed.X_FL);
    if (i < own.size()) padding = own[i];
    const double clear_distance = std::max(padding, tree.interior_gap());
    const double size = tree.center().norm() + tree.radius() + clear_distance;
    Link link;
    link.number = i;
    link.padding = padding;
    link.tree = posed.tree;
    link.solid = posed.solid;
    link.field = posed.field != nullptr && !posed.field->empty() ? posed.field : nullptr;
    link.X_LO = X_OL.inverse();
    link.center_O = (X_OL * tree.center()).cast<float>();
    link.rounding = static_cast<float>(kRounding * (size + X_OL.translation().norm()));
    link.clear_distance = static_cast<float>(clear_distance) + link.rounding;
    link.padded_radius = static_cast<float>(tree.radius()) + link.clear_distance;
    link.first_point = posed.first_point;
    link.last_point = posed.last_point;
    links_.push_back(link);
  }
  group_.reserve(links_.size());
  undecided_.reserve(links_.size());
}

// Whether a sphere may touch what the link claims.
bool SelfFilter::may_touch(const Link& link, const Eigen::Vector3f& center_O, float radius) {
  const float limit = link.padded_radius + radius * (1.0F + static_cast<float>(kRounding));
  return !((center_O - link.center_O).squaredNorm() > limit * limit);
}

bool SelfFilter::begin_group(const PaddedBox& box) {
  const Eigen::Vector3f center = 0.5F * (box.min + box.max).head<3>();
  const float radius = 0.5F * box.diagonal();
  group_.clear();
  for (const Link& link : links_) {
    if (!may_touch(link, center, radius)) continue;
    // A scan has the robot at many instants, of which few are a tile's: those are tested there.
    if (!link.is_for_all_points()) {
      group_.push_back(&link);
      continue;
    }
    const Verdict verdict = test_spheres(
        Effort::kProveClear, link, link.X_LO * center.cast<double>(), static_cast<double>(radius));
    if (verdict != Verdict::kClear) group_.push_back(&link);
  }
  return !group_.empty();
}

SelfFilter::Verdict SelfFilter::test(const PaddedBox& box) {
  return test(box, 0, std::numeric_limits<std::uint32_t>::max());
}

// @param first, last  the least and the greatest id of a point in the box
SelfFilter::Verdict SelfFilter::test(const PaddedBox& box, std::uint32_t first,
                                     std::uint32_t last) {
  const Eigen::Vector3f center = 0.5F * (box.min + box.max).head<3>();
  const float radius = 0.5F * box.diagonal();
  undecided_.clear();
  for (const Link* link : group_) {
    if (last < link->first_point || first > link->last_point) continue;
    if (!may_touch(*link, center, radius)) continue;
    const bool is_for_all = first >= link->first_point && last <= link->last_point;
    const Verdict verdict = test_spheres(Effort::kDecide, *link, link->X_LO * center.cast<double>(),
                                         static_cast<double>(radius));
    if (verdict != Verdict::kClear) undecided_.push_back(link);
    if (verdict == Verdict::kOnRobot && is_for_all) return verdict;
  }
  return undecided_.empty() ? Verdict::kClear : Verdict::kUndecided;
}

std::uint32_t SelfFilter::points_on_robot(const PointTile& tile, const PaddedBox& box) {
  const auto [first, last] = std::minmax_element(tile.id, tile.id + tile.count);
  switch (test(box, *first, *last)) {
    case Verdict::kClear:
      return 0;
    case Verdict::kOnRobot:
      return all_of(tile);
    case Verdict::kUndecided:
      break;
  }
  return undecided_points_on_robot(tile);
}

std::uint32_t SelfFilter::undecided_points_on_robot(const PointTile& tile) const {
  std::uint32_t mask = 0;
  for (const Link* link : undecided_) {
    const std::uint32_t measured = link->is_for_all_points()
                                       ? all_of(tile)
                                       : slots_within(tile, link->first_point, link->last_point);
    mask |= points_on_link(*link, tile, measured & ~mask);
    if (mask == all_of(tile)) break;
  }
  return mask;
}

// @param measured  bits of the points that are asked about
std::uint32_t SelfFilter::points_on_link(const Link& link, const PointTile& tile,
                                         std::uint32_t measured) {
  std::uint32_t mask = 0;
  if (link.field != nullptr) {
    constexpr float kSteps = 4.0F;  // a place is rounded more often in float than a centre
    const FieldVerdict verdict =
        test_by_field(*link.field, link.X_LO.cast<float>(), tile, static_cast<float>(link.padding),
                      kSteps * link.rounding);
    mask = measured & verdict.on_robot;
    measured &= ~(verdict.on_robot | verdict.clear);
  }
  for (std::int32_t k = 0; k < tile.count; ++k) {
    if ((measured >> static_cast<std::uint32_t>(k) & 1U) == 0) continue;
    const Eigen::Vector3f p_O(tile.x[k], tile.y[k], tile.z[k]);
    mask |= static_cast<std::uint32_t>(is_on_link(link, p_O.cast<double>())) << k;
  }
  return mask;
}

bool SelfFilter::is_on_link(const Link& link, const Eigen::Vector3d& p_O) {
  const Eigen::Vector3d p_L = link.X_LO * p_O;
  const Verdict verdict = test_spheres(Effort::kDecide, link, p_L, 0.0);
  return verdict == Verdict::kOnRobot ||
         (verdict == Verdict::kUndecided && test_geometry(link, p_L));
}

// Tests all points within `radius` of a centre at once.
SelfFilter::Verdict SelfFilter::test_spheres(Effort effort, const Link& link,
                                             const Eigen::Vector3d& center_L, double radius) {
  const Eigen::Vector3f c = center_L.cast<float>();
  const float near = link.clear_distance + static_cast<float>(radius) * (1.0F + 1e-6F);
  const float held = static_cast<float>(link.padding - radius) - link.rounding;
  return ist::test_spheres(*link.tree, c.data(), near, held, effort == Effort::kProveClear);
}

bool SelfFilter::test_geometry(const Link& link, const Eigen::Vector3d& p_L) {
  if (is_within_distance(*link.solid, p_L, link.padding)) return true;
  // The point is farther from the surface than the padding: outside, which the tree may prove, or
  // deep inside.
  const double gap = link.tree->interior_gap();
  return link.tree->cover_distance(p_L, gap) <= gap && link.solid->is_inside(p_L);
}

}  // namespace ist
