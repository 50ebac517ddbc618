#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <limits>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Neighbouring open edges of a mesh, side by side for SIMD. Coordinates are from the mesh's origin
/// (OpenEdgeBlocks::View).
struct OpenEdgeBlock {
  static constexpr std::size_t kEdges = 8;

  alignas(32) float from[3][kEdges], along[3][kEdges];  ///< [m] an edge's begin, and from there on
  alignas(32) float per_length_sq[kEdges];              ///< [1/m^2]
  alignas(32) float length[kEdges];                     ///< [m] times count
  alignas(32) float count[kEdges];                      ///< missing partners; 0: no edge
  float center[3], radius;                              ///< [m] of a sphere about the edges
  float sum_along[3];                                   ///< [m] of all edges, times count
  float sum_length;                                     ///< [m] of all edges, times count
};

/// Sums over the open edges say how the winding number changes about a place, as in the law of Biot
/// and Savart.
struct OpenEdgeSums {
  double field[3] = {};      ///< [1/m] the winding number's gradient, times 4 pi
  double field_error = 0.0;  ///< [1/m] by how much the field may be wrong
  double curvature = 0.0;    ///< [1/m^2] a bound of the derivative of the field, at the place
  double nearest = std::numeric_limits<double>::infinity();  ///< [m] distance of the nearest edge
};

/// The open edges of a mesh, for bounds of how its winding number changes. Immutable; const members
/// are thread safe and allocate nothing.
class OpenEdgeBlocks {
 public:
  OpenEdgeBlocks() = default;
  /// @throws Cancelled
  explicit OpenEdgeBlocks(const TriangleMesh& mesh, const CancelRequest& cancelled = {});

  /// [m] The winding number differs by no more than `change` from that at p_M at all places nearer
  /// than this which a straight line from p_M reaches without crossing the surface.
  ///
  /// Off the surface the winding number is smooth, and its gradient is an integral along the open
  /// edges alone, as the magnetic field is along a current (the law of Biot and Savart, for the
  /// solid angle of a surface). The gradient at p_M is summed up, and its derivative bounded by
  /// 2 length / (4 pi distance^3) of each edge.
  /// @param max_radius  [m] the result is no larger
  double steady_radius(const Eigen::Vector3d& p_M, double change, double max_radius) const;

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  // [m] mesh frame
  double extent_ = 0.0;                               // [m] of the edges about the origin
  std::vector<OpenEdgeBlock> blocks_;
};

/// The SIMD kernel of steady_radius().
/// @param p  [m] a place, from the origin of the blocks
void sum_open_edges(const std::vector<OpenEdgeBlock>& blocks, const float* p, OpenEdgeSums* sums);

}  // namespace ist
