#include "internal/geometry/distance_field.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/solid_element.h"
#include "internal/geometry/outside_margin.h"
#include "internal/geometry/solid_queries.h"

namespace ist {
namespace {

// The nested grids: the edge of a cell, and how far a grid reaches beyond the box about the solid.
// At a grid's end its error is about a millimetre. Halving all edges spares a query every tenth
// exact distance, and takes four times as long and as much memory.
struct Grid {
  double cell, margin;  // [m]
};
constexpr std::array<Grid, 5> kGrids = {
    {{0.005, 0.03}, {0.01, 0.1}, {0.02, 0.3}, {0.04, 0.7}, {0.08, 1.2}}};
// Nodes of a grid, at most: about a large solid cells are larger.
constexpr double kMaxNodes = 2e5;
constexpr double kCellGrowth = 1.25;
constexpr double kCoarseCells = 3.0;  // their edges, as multiples of fine ones
// The same of the grid of depths.
constexpr double kDepthCell = 0.005, kMaxDepthNodes = 5e4;
// [m] More than double loses in the distance of a link's places.
constexpr double kFieldRounding = 1e-9;

Eigen::Array3i nodes_of(const Eigen::AlignedBox3d& box, double cell) {
  return (box.sizes().array() / cell).ceil().max(1.0).cast<int>() + 1;
}

}  // namespace

class DistanceField::Builder {
 public:
  Builder(const Solid& solid, const CancelRequest& cancelled, DistanceField* field)
      : solid_(solid),
        watch_(cancelled),
        field_(*field),
        scale_(field->detail_ == Detail::kCoarse ? kCoarseCells : 1.0),
        node_share_(1.0 / (scale_ * scale_ * scale_)) {}

  void run() {
    if (solid_.empty() || !find_bounds()) return;
    field_.is_closed_ = solid_.is_closed();
    for (std::size_t i = 0; i < kGrids.size(); ++i) {
      Eigen::AlignedBox3d box = bounds_;
      box.min().array() -= kGrids[i].margin;
      box.max().array() += kGrids[i].margin;
      const double cell = cell_for(box, kGrids[i].cell, kMaxNodes);
      // Cells that are no smaller than those of the next grid are of no use.
      if (i + 1 < kGrids.size() && cell >= scale_ * kGrids[i + 1].cell) continue;
      add_level(box, cell);
    }
    if (elements_of(solid_).size() == 1) add_depths();
    field_.values_.resize(field_.values_.size() + kPadding, kFar);
    field_.outside_.resize(field_.outside_.size() + kPadding, 0);
  }

 private:
  // @returns false for a solid without a surface
  bool find_bounds() {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d n = Eigen::Vector3d::Unit(axis);
      bounds_.max()[axis] = support(solid_, n);
      bounds_.min()[axis] = -support(solid_, -n);
    }
    if (bounds_.isEmpty() || !bounds_.sizes().allFinite()) return false;
    // The inside of a mesh with holes ends at the box about it in its own frame.
    for (const SolidElement& element : elements_of(solid_)) {
      if (element.is_closed) continue;
      const Eigen::AlignedBox3d& box = element.bvh.bounds();
      for (int corner = 0; corner < 8; ++corner) {
        bounds_.extend(element.X_LE *
                       box.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner)));
      }
    }
    // More than float loses.
    const double slack = 1e-6 * (1.0 + std::max(bounds_.min().cwiseAbs().maxCoeff(),
                                                bounds_.max().cwiseAbs().maxCoeff()));
    bounds_.min().array() -= slack;
    bounds_.max().array() += slack;
    field_.bounds_ = bounds_.cast<float>();
    return true;
  }

  // [m] The edge of a cell.
  // @param fine  of a fine field's cells about a small box
  // @param most  nodes of a fine field's grid
  double cell_for(const Eigen::AlignedBox3d& box, double fine, double most) const {
    double cell = scale_ * fine;
    while (nodes_of(box, cell).cast<double>().prod() > node_share_ * most) cell *= kCellGrowth;
    return cell;
  }

  // A grid about the middle of a box that holds the box.
  static Level make_level(const Eigen::AlignedBox3d& box, double cell, std::size_t first) {
    const Eigen::Array3i size = nodes_of(box, cell);
    const Eigen::Vector3d low = box.center() - 0.5 * cell * (size - 1).cast<double>().matrix();
    Level level;
    for (int axis = 0; axis < 3; ++axis) {
      level.low[axis] = static_cast<float>(low[axis]);
      level.size[axis] = size[axis];
    }
    level.cell = static_cast<float>(cell);
    level.per_cell = 1.0F / level.cell;
    level.first = first;
    return level;
  }

  // Measures the nodes of a grid and calls take() with the place of each.
  template <class Take>
  void measure_nodes(const Level& level, const Take& take) {
    cell_ = static_cast<double>(level.cell);
    for (int z = 0; z < level.size[2]; ++z) {
      for (int y = 0; y < level.size[1]; ++y) {
        forget();
        for (int x = 0; x < level.size[0]; ++x) {
          watch_.step();
          const Eigen::Vector3d p_L(level.node(0, x), level.node(1, y), level.node(2, z));
          measure(p_L);
          take(p_L);
        }
      }
    }
  }

  void add_level(const Eigen::AlignedBox3d& box, double cell) {
    const Level level = make_level(box, cell, field_.values_.size());
    field_.values_.reserve(level.first + level.count() + kPadding);
    const bool is_finest = field_.levels_.empty();
    measure_nodes(level, [&](const Eigen::Vector3d& p_L) {
      field_.values_.push_back(
          static_cast<std::uint16_t>(steps(distance_, static_cast<double>(kStep), kFar)));
      if (!is_finest) return;
      const double radius = outside_radius(p_L);
      field_.outside_.push_back(
          static_cast<std::uint8_t>(steps(radius, static_cast<double>(kOutsideStep), 255.0)));
    });
    field_.levels_.push_back(level);
  }

  void add_depths() {
    const Level level = make_level(bounds_, cell_for(bounds_, kDepthCell, kMaxDepthNodes), 0);
    std::vector<Eigen::Vector3f> to_surface;
    std::vector<std::uint16_t> balls;
    to_surface.reserve(level.count());
    balls.reserve(level.count());
    float largest = 0.0F;
    bool have_surface = true;
    measure_nodes(level, [&](const Eigen::Vector3d& p_L) {
      have_surface = have_surface && has_surface_;
      to_surface.emplace_back((surface_L_ - p_L).cast<float>());
      largest = std::max(largest, to_surface.back().cwiseAbs().maxCoeff());
      balls.push_back(static_cast<std::uint16_t>(
          steps(outside_radius(p_L), static_cast<double>(kBallStep), 65535.0)));
    });
    constexpr float kMost = 32767.0F;
    if (!have_surface || !(largest > 0.0F) || !std::isfinite(largest)) return;
    field_.surface_step_ = largest / kMost;
    const auto join = [](std::uint16_t low, std::uint16_t high) {
      return low | static_cast<std::uint32_t>(high) << 16U;
    };
    for (std::size_t i = 0; i < balls.size(); ++i) {
      std::uint16_t parts[3];
      for (int axis = 0; axis < 3; ++axis) {
        const float at = to_surface[i][axis] / field_.surface_step_;
        parts[axis] = static_cast<std::uint16_t>(
            static_cast<std::int16_t>(std::lround(std::clamp(at, -kMost, kMost))));
      }
      field_.surface_xy_.push_back(join(parts[0], parts[1]));
      field_.surface_z_ball_.push_back(join(parts[2], balls[i]));
    }
    field_.depths_ = level;
  }

  static double steps(double distance, double step, double most) {
    return std::clamp(std::floor((distance - kFieldRounding) / step), 0.0, most);
  }

  // The first node of a row knows nothing of its neighbour.
  void forget() {
    upper_ = std::numeric_limits<double>::infinity();
    has_surface_ = false;
    side_ = Side::kUnknown;
    side_radius_ = 0.0;
  }

  // A lower bound of the distance of the next node of a row, which is a cell away from the last.
  void measure(const Eigen::Vector3d& p_L) {
    // The surface point of the last node is a surface point still.
    const Eigen::Vector3d from_last = p_L - surface_L_;
    const double to_last =
        has_surface_ ? from_last.norm() : std::numeric_limits<double>::infinity();
    if (has_surface_ && to_last > 0.0) hint_L_ = from_last / to_last;
    const double limit =
        std::min(upper_ + cell_, to_last) * (1.0 + kFieldRounding) + kFieldRounding;
    const double tolerance =
        cell_ / static_cast<double>(kSlackParts) * std::min(cell_ / std::max(upper_, cell_), 1.0);
    const SignedDistance found =
        distance_outside(solid_, p_L, limit, hint_L_, tolerance, &distance_);
    upper_ = std::min(std::max(found.distance, 0.0), limit);
    surface_L_ = found.witness;
    has_surface_ = found.distance < std::numeric_limits<double>::infinity();
    hint_L_ = found.normal;
  }

  // [m] No surface and no place inside is nearer to the node that was measured last.
  double outside_radius(const Eigen::Vector3d& p_L) {
    // The ball about the node before, which is a cell away, tells the side of all places in it.
    side_radius_ -= cell_;
    const double from_bounds = bounds_.exteriorDistance(p_L);
    if (from_bounds >= distance_) return distance_;
    if (!(distance_ > 0.0)) return from_bounds;
    if (!field_.is_closed_) {
      return std::max(from_bounds, outside_margin(solid_, p_L, distance_).margin);
    }
    if (!(side_radius_ > 0.0)) {
      side_ = solid_.is_inside(p_L) ? Side::kInside : Side::kOutside;
    }
    side_radius_ = std::max(side_radius_, distance_);
    return side_ == Side::kOutside ? distance_ : 0.0;
  }

  using Side = NearSurface::Side;

  const Solid& solid_;
  CancelWatch watch_;
  DistanceField& field_;
  const double scale_, node_share_;  // of edges and of nodes, by the detail
  Eigen::AlignedBox3d bounds_;       // [m] of the solid
  double cell_ = 0.0;                // [m] of the level at work
  // The next seven are about the node that was measured last.
  double distance_ = 0.0, upper_ = 0.0;  // [m] bounds of its distance
  Eigen::Vector3d hint_L_ = Eigen::Vector3d::Zero(), surface_L_ = Eigen::Vector3d::Zero();
  bool has_surface_ = false;    // whether a point of the surface was found
  Side side_ = Side::kUnknown;  // of a closed solid
  double side_radius_ = 0.0;    // [m] places that are nearer are on the same side
};

DistanceField::DistanceField(const Solid& solid, Detail detail, const CancelRequest& cancelled)
    : detail_(detail) {
  Builder(solid, cancelled, this).run();
}

}  // namespace ist
