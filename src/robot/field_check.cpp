#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <limits>

#include "field_cache.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// So many nodes of each grid are measured again.
constexpr std::size_t kCheckedNodes = 64;
// [m] More than double loses in the distance of a link's places.
constexpr double kRounding = 1e-9;

/// The nodes of a grid that are compared with the geometry.
class FieldSamples {
 public:
  FieldSamples(const DistanceField& field, const Solid& solid) : field_(field), solid_(solid) {}

  bool are_right() {
    for (const DistanceField::Level& level : field_.levels()) {
      const bool is_finest = &level == field_.levels().data();
      const auto is_right = [&](std::size_t i) {
        return is_distance(level, field_.values()[level.first + i]) &&
               (!is_finest ||
                is_ball(static_cast<double>(DistanceField::kOutsideStep) * field_.outside()[i]));
      };
      if (!check(level, is_right)) return false;
    }
    const auto is_depth = [&](std::size_t i) {
      const std::uint32_t xy = field_.surface_xy()[i], z_ball = field_.surface_z_ball()[i];
      return is_surface(xy & 0xFFFFU, xy >> 16U, z_ball & 0xFFFFU) &&
             is_ball(static_cast<double>(DistanceField::kBallStep) * (z_ball >> 16U));
    };
    return !field_.has_depths() || check(field_.depths(), is_depth);
  }

 private:
  // Calls is_right() with nodes spread over a grid, of which p_L_ and distance_ are known then.
  template <class IsRight>
  bool check(const DistanceField::Level& level, const IsRight& is_right) {
    const std::size_t count = level.count(), step = std::max<std::size_t>(count / kCheckedNodes, 1);
    for (std::size_t i = step / 2; i < count; i += step) {
      const auto x = static_cast<int>(i % static_cast<std::size_t>(level.size[0]));
      const std::size_t row = i / static_cast<std::size_t>(level.size[0]);
      const auto y = static_cast<int>(row % static_cast<std::size_t>(level.size[1]));
      const auto z = static_cast<int>(row / static_cast<std::size_t>(level.size[1]));
      p_L_ = {level.node(0, x), level.node(1, y), level.node(2, z)};
      distance_ = surface_distance(p_L_);
      if (!is_right(i)) return false;
    }
    return true;
  }

  double surface_distance(const Eigen::Vector3d& p_L) const {
    double lower_bound = 0.0;
    distance_outside(solid_, p_L, std::numeric_limits<double>::infinity(), Eigen::Vector3d::Zero(),
                     0.0, &lower_bound);
    return std::max(lower_bound, 0.0);
  }

  bool is_distance(const DistanceField::Level& level, std::uint16_t value) const {
    const double step = static_cast<double>(DistanceField::kStep);
    const double slack =
        step + static_cast<double>(level.cell / DistanceField::kSlackParts) + kRounding;
    return step * value <= distance_ + kRounding &&
           (value == DistanceField::kFar || step * value >= distance_ - slack);
  }

  // Whether no surface and nothing inside is in a ball about the node.
  bool is_ball(double radius) const {
    const double from_box = field_.bounds().cast<double>().exteriorDistance(p_L_);
    return radius <= std::max(distance_, from_box) + kRounding &&
           !(radius > 0.0 && solid_.is_inside(p_L_));
  }

  bool is_surface(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    const double step = static_cast<double>(field_.surface_step());
    const auto along = [&](std::uint32_t part) {
      return step * static_cast<std::int16_t>(static_cast<std::uint16_t>(part));
    };
    return surface_distance(p_L_ + Eigen::Vector3d(along(x), along(y), along(z))) <=
           2.0 * step + kRounding;
  }

  const DistanceField& field_;
  const Solid& solid_;
  Eigen::Vector3d p_L_ = Eigen::Vector3d::Zero();
  double distance_ = 0.0;  // [m] from p_L_ to the surface
};

}  // namespace

std::string field_fault(const DistanceField& field, const Solid& solid) {
  if (field.is_closed() != solid.is_closed()) return "it is of a mesh with other holes";
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d n = Eigen::Vector3d::Unit(axis);
    const bool is_held = static_cast<double>(field.bounds().max()[axis]) >= support(solid, n) &&
                         static_cast<double>(field.bounds().min()[axis]) <= -support(solid, -n);
    if (!is_held) return "its box does not hold the geometry";
  }
  return FieldSamples(field, solid).are_right() ? ""
                                                : "its distances are not those of the geometry";
}

}  // namespace ist
