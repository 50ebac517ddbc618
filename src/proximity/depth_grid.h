#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "internal/geometry/solid_queries.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Signed distances of a link at the middles of cells about it, each measured when it is first
/// asked for, and kept: they belong to the link alone, so they hold at every pose, for every cloud.
/// From a cell's middle to a place nearby the distance changes by no more than the way. So they
/// tell which places cannot be deep. Memory is fixed.
class DepthGrid {
 public:
  explicit DepthGrid(const LinkModel& link);

  struct Found {
    double floor = 0.0;  ///< [m] at the place, see PointDepth
    NearSurface near;    ///< of the place
  };

  /// Of a place in a cell that has been measured. False: it is in none.
  bool look(const Eigen::Vector3d& p_L, Found* found) const;
  /// Measures the place's cell if it has not been. A place beyond all cells is told by the nearest
  /// one, which is little.
  Found measure(const Eigen::Vector3d& p_L);

  static constexpr std::size_t kMostCells = 32768;

 private:
  struct Cell {
    std::size_t index;
    Eigen::Vector3d middle;  ///< [m] link frame
  };
  static constexpr float kUnknown = 1e30F;

  Cell cell(const Eigen::Vector3d& p_L) const;
  Found tell(const Eigen::Vector3d& p_L, const Cell& cell) const;

  const Solid* solid_;
  bool tells_surface_, has_holes_;
  Eigen::AlignedBox3d box_;  ///< of all cells, link frame
  double size_, per_size_;   ///< [m] of a cell, and 1 / that
  Eigen::Array3i count_;
  std::vector<float> values_;  ///< [m] PointDepth::floor
};

}  // namespace ist
