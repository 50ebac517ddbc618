#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <vector>

#include "internal/geometry/solid_queries.h"
#include "ist_proximity/robot/robot_model.h"

namespace ist {

/// Signed distances of a link on a grid about it. Each cell is measured at its centre when it is
/// first asked for, and kept: the values belong to the link alone, so they hold at every pose and
/// for every cloud. A signed distance changes by no more than the distance between two places, so a
/// cell's value bounds it at every place nearby. Memory is allocated once. One thread.
class SignedDistanceGrid {
 public:
  explicit SignedDistanceGrid(const LinkModel& link);

  struct Sample {
    double lower_bound = 0.0;  ///< [m] PointDepth::floor at the place, at least
    NearSurface near;          ///< what is known of the surface about the place
  };

  /// The sample of a place in a cell that has been measured. False: there is none.
  bool find(const Eigen::Vector3d& p_LQ, Sample* sample) const;
  /// Measures the place's cell if it has not been. A place outside the grid is bounded by the
  /// nearest cell, loosely.
  Sample measure(const Eigen::Vector3d& p_LQ);

  static constexpr std::size_t kMaxCells = 32768;

 private:
  struct Cell {
    std::size_t index;
    Eigen::Vector3d center;  ///< [m] link frame
  };
  static constexpr float kUnknown = 1e30F;

  Cell cell(const Eigen::Vector3d& p_LQ) const;
  Sample sample(const Eigen::Vector3d& p_LQ, const Cell& cell) const;

  const Solid* solid_;
  bool is_one_mesh_, has_holes_;
  Eigen::AlignedBox3d box_;  ///< of all cells, link frame
  double size_, per_size_;   ///< [m] edge of a cell, and 1 / edge
  Eigen::Array3i count_;
  std::vector<float> values_;  ///< [m] PointDepth::floor
};

}  // namespace ist
