#pragma once

#include <hwy/cache_control.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/cloud/point_tile.h"
#include "internal/geometry/solid_queries.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Signed distances of a link about it, on a grid whose cells are measured when they are first
/// needed and kept: they belong to the link alone, so they hold at every pose and for every cloud.
///
/// A cell bounds the signed distance of the places near its centre C in three ways:
///  - It changes by no more than the distance between two places (it is 1-Lipschitz).
///  - A local supporting plane, across the direction of the surface point closest to C, has all of
///    the surface near C on one side. The surface is no nearer to a place on the other side than
///    the plane is; and if the link is a closed solid, such places are all outside, or none is.
///  - The triangle that is closest to C is no deeper than the surface.
/// The error of the first is the distance from C, that of the others falls with its square where
/// the surface is smooth.
///
/// The error of a plane also falls with the distance of the surface, so farther away cells are
/// larger: set_distance() chooses the level.
///
/// Cells are held in a direct-mapped table: a cell whose place another one needs is measured again.
/// Memory is allocated once. One thread.
class SignedDistanceGrid {
 public:
  explicit SignedDistanceGrid(const LinkModel& link);

  /// Takes another copy of the same solid; what was measured stays.
  void set_solid(const Solid& solid) { solid_ = &solid; }

  std::size_t memory() const { return cells_.capacity() * sizeof(Cell); }  ///< [bytes]

  /// A part of space: a place, a sphere, or a box and the points that are in it.
  struct Part {
    Eigen::Vector3d center_L;                        ///< [m]
    double radius = 0.0;                             ///< [m] of a bounding sphere about the centre
    const Eigen::Matrix3d* R_LO = nullptr;           ///< of the box; null: a sphere
    Eigen::Vector3d half = Eigen::Vector3d::Zero();  ///< [m] half edges of the box, in O
    const PointTile* points = nullptr;               ///< null: all of the box
    Eigen::Vector3d center_O = Eigen::Vector3d::Zero();  ///< [m]

    /// [m] How far it extends from the centre against a direction.
    double extent_against(const Eigen::Vector3d& n_L) const;
    /// [m] No place of it is farther from p_LA.
    double reach_from(const Eigen::Vector3d& p_LA) const;
  };

  /// A bound of all places of a part of space.
  struct Bound {
    /// [m] No place has a smaller signed distance, in the sense of PointDepth::floor.
    double signed_distance = -std::numeric_limits<double>::infinity();
    /// [m] The surface is no nearer to any place.
    double surface_distance = 0.0;
    /// Whether every place is outside.
    bool is_outside = false;
  };

  struct Cell;

  /// Chooses the size of cells for places that are about as far [m] from the link.
  void set_distance(double distance);
  /// Brings the cell of a place near for find(), which else waits for memory.
  void prefetch(const Eigen::Vector3d& p_LQ) const { hwy::Prefetch(&cells_[slot(key(p_LQ))]); }
  /// The cell of a place, if it has been measured; null otherwise, and for a place that is not
  /// finite or too far from the link.
  Cell* find(const Eigen::Vector3d& p_LQ);
  /// Measures the place's cell if it has not been. Null as above.
  Cell* measure(const Eigen::Vector3d& p_LQ);

  /// The bound of a part by a cell, which may be any.
  /// @param enough  [m] a bound of the surface's distance that needs no better; inf: the best
  Bound bound(Cell* cell, const Part& part, double enough) const;
  /// [m] No place in the sphere has a smaller signed distance. The cell's plane is not used.
  double floor_bound(const Cell& cell, const Eigen::Vector3d& center_L, double radius) const;
  /// [m] No place of a part is deeper than minus this, by the cell's triangle; -inf: unknown.
  double depth_bound(const Cell& cell, const Part& part) const;
  /// [m] Every place nearer than this to a place of a part is outside a mesh with holes; not
  /// positive: unknown.
  double outside_margin(Cell* cell, const Part& part) const;
  /// [m] Larger parts are bounded by no plane.
  double plane_radius() const { return plane_radius(level_); }
  /// Bounds of where the surface is about a place.
  NearSurface near_surface(Cell* cell, const Eigen::Vector3d& p_LQ) const;

  struct Cell {
    std::uint64_t key = 0;  ///< of the place in the grid; 0: not measured
    Eigen::Vector3f normal = Eigen::Vector3f::Zero();  ///< outward, at the closest point
    float witness = 0.0F;                              ///< [m] from C to that point along normal
    float floor = 0.0F;                                ///< [m] PointDepth::floor at C
    float plane = std::numeric_limits<float>::max();   ///< [m] from C to the plane along normal
    std::uint32_t triangle = kNoTriangle;              ///< of a solid that is one mesh
    bool has_plane = false;                            ///< whether the plane was looked for
    bool is_outside_above_plane = false;               ///< every place there that the plane bounds
    bool has_margin = false;                           ///< whether the margin was looked for
    /// Places that a way from C reaches which does not cross the surface, and is shorter than so
    /// many 1 / kMarginParts of the cell's edge, are outside a mesh with holes.
    std::uint8_t margin = 0;
  };

 private:
  static constexpr std::size_t kCells = 8192;
  static constexpr std::uint32_t kNoTriangle = std::numeric_limits<std::uint32_t>::max();
  static constexpr int kMaxLevel = 7;
  static constexpr double kMarginParts = 64.0;  // a byte reaches four edges

  std::uint64_t key(const Eigen::Vector3d& p_LQ) const;
  static std::size_t slot(std::uint64_t key) { return (key * 0x9E3779B97F4A7C15ULL) >> 51U; }
  static int level(const Cell& cell) { return static_cast<int>(cell.key >> kLevelShift) - 1; }
  Eigen::Vector3d center(const Cell& cell) const;  ///< [m] C
  double size(int level) const {
    return static_cast<double>(1U << static_cast<unsigned>(level)) * size_;
  }
  double plane_radius(int level) const;
  template <class Visit>
  void for_each_neighbor(std::uint64_t key, const Visit& visit) const;
  NearSurface known_by_neighbors(const Cell& cell, const Eigen::Vector3d& center) const;
  void fill(Cell* cell) const;
  void find_plane(Cell* cell) const;

  // A key holds the level + 1 above the three indices of a cell.
  static constexpr unsigned kIndexBits = 19, kLevelShift = 3 * kIndexBits;

  const Solid* solid_;
  bool is_one_mesh_, is_closed_;
  Eigen::Vector3d origin_;  ///< [m] link frame
  double size_;             ///< [m] edge of a cell of level 0; each level doubles it
  int level_ = 0;           ///< of cells that are found and measured
  double per_size_;         ///< [1/m] 1 / edge
  std::vector<Cell> cells_;
};

}  // namespace ist
