#include "proximity/coherence/side_balls.h"

#include <algorithm>
#include <cmath>

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

// [m] The edge of a cell. Near open edges balls are about a millimetre large.
constexpr double kCell = 0.002;
// [m] Places that are farther from the link's origin have no cell: its number might overflow.
constexpr double kFarAway = 1e6;
// [m] More than double loses in the distance of two places of a link.
constexpr double kRounding = 1e-9;

// Written so that NaN has no cell.
bool has_cell(const Eigen::Vector3d& p_LQ) {
  return std::abs(p_LQ.x()) < kFarAway && std::abs(p_LQ.y()) < kFarAway &&
         std::abs(p_LQ.z()) < kFarAway;
}

std::int64_t cell_of(double coordinate) {
  return static_cast<std::int64_t>(std::floor(coordinate / kCell));
}

}  // namespace

std::size_t SideBalls::set_of(const std::int64_t cell[3]) const {
  const auto bits = [cell](int axis) { return static_cast<std::uint64_t>(cell[axis]); };
  const std::uint64_t mixed = bits(0) * 0x9E3779B97F4A7C15ULL ^ bits(1) * 0xC2B2AE3D27D4EB4FULL ^
                              bits(2) * 0x165667B19E3779F9ULL;
  return (mixed * 0x9E3779B97F4A7C15ULL) >> 32U & (sets_.size() - 1);
}

// The two nearest cells along each axis hold the centres of all balls about the place that are no
// larger than half a cell, and of many others.
SideBalls::Found SideBalls::find(const Eigen::Vector3d& p_LQ) const {
  Found found;
  if (!has_cell(p_LQ)) return found;
  std::int64_t low[3];
  for (int axis = 0; axis < 3; ++axis) low[axis] = cell_of(p_LQ[axis] - 0.5 * kCell);
  for (int i = 0; i < 8; ++i) {
    const std::int64_t cell[3] = {low[0] + i % 2, low[1] + i / 2 % 2, low[2] + i / 4};
    const Set& set = sets_[set_of(cell)];
    for (const Ball& ball : set.balls) {
      const double x = p_LQ.x() - static_cast<double>(ball.x),
                   y = p_LQ.y() - static_cast<double>(ball.y),
                   z = p_LQ.z() - static_cast<double>(ball.z);
      const double margin =
          static_cast<double>(std::abs(ball.radius)) - std::sqrt(x * x + y * y + z * z) - kRounding;
      if (!(margin > found.margin)) continue;
      found = {ball.radius < 0.0F ? Side::kInside : Side::kOutside, margin};
    }
  }
  return found;
}

void SideBalls::store(const Eigen::Vector3d& p_LQ, const Found& found) {
  if (found.side == Side::kUnknown || !has_cell(p_LQ)) return;
  const Eigen::Vector3f center = p_LQ.cast<float>();
  const float radius = round_down(found.margin - (p_LQ - center.cast<double>()).norm() - kRounding);
  if (!(radius > 0.0F)) return;
  const std::int64_t cell[3] = {cell_of(p_LQ.x()), cell_of(p_LQ.y()), cell_of(p_LQ.z())};
  Set& set = sets_[set_of(cell)];
  Ball* smallest = set.balls;
  for (Ball& ball : set.balls) {
    if (std::abs(ball.radius) < std::abs(smallest->radius)) smallest = &ball;
  }
  *smallest = {center.x(), center.y(), center.z(), found.side == Side::kInside ? -radius : radius};
}

}  // namespace ist
