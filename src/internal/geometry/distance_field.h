#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/solid.h"

namespace ist {

/// Distances from a solid, measured at the nodes of nested regular grids, whose cells are larger
/// the farther from the solid they are. What lies between the nodes is bounded, so that a look-up
/// proves how near a place may be.
///
/// **Lower bound.** Let E be the trilinear interpolation of the squares of the nodes' distances at
/// a place p within a cell, and t_i in [0, 1] where p is between the nodes along axis i. Then
///   distance(p)^2 >= E - edge^2 (t_1 (1 - t_1) + t_2 (1 - t_2) + t_3 (1 - t_3)).
/// The weights of the interpolation are the probabilities of a random node V with mean p, whose
/// coordinates are independent and have the variances edge^2 t_i (1 - t_i). Let s be the surface
/// point closest to p. E is no more than the mean of |V - s|^2 = |p - s|^2 + the sum of the
/// variances. The error is of second order in the edge, where that of a single node is of first
/// order, and the solid need not be convex. The same holds in any box, with the distances at its
/// corners.
///
/// **Upper bound.** distance(p) <= the mean of distance(V) + |V - p| <= sqrt(E) + half the diagonal
/// of the cell.
///
/// **Outside.** About each node of the finest grid, a ball holds no surface and no place inside the
/// solid. The finest grid covers the box about the solid, and beyond that box all is outside.
///
/// **Depth.** A grid over the box about the solid holds, for each node, the surface point s that is
/// closest to it. A place p inside is no deeper than |p - s|, for any of them. For the nodes about
/// p the error is of second order in the edge, but where the closest point jumps. It holds balls
/// about the nodes, too, which are finer than those of the finest grid.
///
/// Immutable; const members are thread safe.
class DistanceField {
 public:
  /// A grid of nodes; x runs fastest.
  struct Level {
    float low[3];                ///< [m] the first node, in the frame of the solid
    float cell, per_cell;        ///< [m], [1/m] the edge of a cell
    std::int32_t size[3];        ///< nodes along each axis, at least 2
    std::size_t first;           ///< of its nodes in values(), or in one of the arrays below
    std::size_t count() const {  ///< of its nodes
      return static_cast<std::size_t>(size[0]) * static_cast<std::size_t>(size[1]) *
             static_cast<std::size_t>(size[2]);
    }
    double node(int axis, int i) const {  ///< [m] the i-th coordinate of its nodes
      return static_cast<double>(low[axis]) + i * static_cast<double>(cell);
    }
  };

  /// How long the edges of all cells are.
  enum class Detail {
    /// Three times as long as fine ones, and longer about large, flat and thin solids: far fewer
    /// nodes.
    kCoarse,
    kFine,
  };

  /// @throws Cancelled
  explicit DistanceField(const Solid& solid, Detail detail = Detail::kFine,
                         const CancelRequest& cancelled = {});

  Detail detail() const { return detail_; }

  bool empty() const { return levels_.empty(); }
  const std::vector<Level>& levels() const { return levels_; }  ///< finest first, each in the next
  /// Lower bounds of the distances at the nodes, too low by kStep and 1 / kSlackParts of a cell at
  /// most, in units of kStep. kFar stands for all that are larger.
  const std::vector<std::uint16_t>& values() const { return values_; }
  /// Radii of the balls about the nodes of the finest grid, in units of kOutsideStep, rounded down.
  const std::vector<std::uint8_t>& outside() const { return outside_; }
  /// The grid of depths. It has no nodes where the depth of a place is not its distance from the
  /// surface: for a solid of several elements.
  const Level& depths() const { return depths_; }
  bool has_depths() const { return !surface_xy_.empty(); }
  /// Each entry is a vector from a node of that grid to a surface point, in units of
  /// surface_step(): x is in the lower half, y in the upper one.
  const std::vector<std::uint32_t>& surface_xy() const { return surface_xy_; }
  /// The same: z in the lower half. In the upper one, the radius of the node's ball that holds
  /// nothing inside, in units of kBallStep, rounded down.
  const std::vector<std::uint32_t>& surface_z_ball() const { return surface_z_ball_; }
  float surface_step() const { return surface_step_; }  ///< [m]
  /// [m] A box about the solid, rounded outward.
  const Eigen::AlignedBox3f& bounds() const { return bounds_; }
  /// Whether the solid is closed: then the distance of a place outside is that of all that is
  /// inside as well.
  bool is_closed() const { return is_closed_; }
  std::size_t memory() const {  ///< [bytes]
    return sizeof *this + values_.capacity() * sizeof(std::uint16_t) + outside_.capacity() +
           levels_.capacity() * sizeof(Level) + surface_xy_.capacity() * sizeof(std::uint32_t) +
           surface_z_ball_.capacity() * sizeof(std::uint32_t);
  }

  static constexpr float kStep = 1.0F / 16384.0F;        ///< [m]
  static constexpr std::uint16_t kFar = 65535;           ///< 4 m
  static constexpr float kOutsideStep = 1.0F / 2048.0F;  ///< [m]
  static constexpr float kBallStep = 1.0F / 32768.0F;    ///< [m] the largest ball has 2 m
  static constexpr float kSlackParts = 16.0F;
  /// Values are read by the pair and radii by fours: so many more of each can be read.
  static constexpr std::size_t kPadding = 3;

 private:
  class Builder;
  friend class FieldFile;  // which reads and writes the members
  DistanceField() = default;

  std::vector<Level> levels_;
  std::vector<std::uint16_t> values_;
  std::vector<std::uint8_t> outside_;
  Level depths_{};
  std::vector<std::uint32_t> surface_xy_, surface_z_ball_;
  float surface_step_ = 0.0F;
  Eigen::AlignedBox3f bounds_;
  bool is_closed_ = false;
  Detail detail_ = Detail::kFine;
};

}  // namespace ist
