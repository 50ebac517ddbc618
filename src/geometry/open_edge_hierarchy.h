#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "internal/geometry/boundary_edges.h"
#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Neighbouring open edges of a mesh, side by side for SIMD. Coordinates are from the origin of an
/// OpenEdgeHierarchy.
struct OpenEdgeBlock {
  static constexpr std::size_t kEdges = 8;

  alignas(32) float from[3][kEdges], along[3][kEdges];  ///< [m] an edge's begin, and from there on
  alignas(32) float per_length_sq[kEdges];              ///< [1/m^2]
  alignas(32) float length[kEdges];                     ///< [m] times count
  alignas(32) float count[kEdges];                      ///< missing partners; 0: no edge
};

/// Clusters of open edges as they act from afar, side by side for SIMD: the first two moments about
/// the centre of a bounding sphere.
struct OpenEdgeNode {
  static constexpr std::size_t kChildren = 8;

  alignas(32) float center[3][kChildren], radius[kChildren];  ///< [m] of the sphere
  alignas(32) float sum[3][kChildren];                        ///< [m] of the edges, times count
  /// [m^2] The integral of (place - center)[i] along axis j, over the edges, times count.
  alignas(32) float moment[3][3][kChildren];
  alignas(32) float length[kChildren];  ///< [m] sum of lengths, times count; 0: no child
  std::int32_t child[kChildren];        ///< a node; ~block
};

/// Sums over the open edges say how the winding number changes about a place, as in the law of Biot
/// and Savart.
struct OpenEdgeSums {
  double field[3] = {};      ///< [1/m] the winding number's gradient, times 4 pi
  double field_error = 0.0;  ///< [1/m] by how much the field may be wrong
  double curvature = 0.0;    ///< [1/m^2] a bound of the derivative of the field, at the place
  double nearest = std::numeric_limits<double>::infinity();  ///< [m] no edge is nearer
};

/// The open edges of a mesh, for bounds of how its winding number changes. What is far is summed up
/// by clusters, as in the fast multipole method (Greengard and Rokhlin, 1987). Immutable; const
/// members are thread safe and allocate nothing.
class OpenEdgeHierarchy {
 public:
  struct Edge {
    Eigen::Vector3d from, to;  ///< [m] mesh frame
    double count = 1.0;        ///< missing partners
  };

  OpenEdgeHierarchy() = default;
  /// @throws Cancelled
  explicit OpenEdgeHierarchy(const TriangleMesh& mesh, const CancelRequest& cancelled = {});
  /// @param open  open_edges(mesh)
  /// @throws Cancelled
  OpenEdgeHierarchy(const TriangleMesh& mesh, const std::vector<OpenEdge>& open,
                    const CancelRequest& cancelled);
  /// @throws Cancelled
  explicit OpenEdgeHierarchy(std::vector<Edge> edges, const CancelRequest& cancelled = {});

  /// [m] The winding number differs by no more than `change` from that at p_M at all places which a
  /// way from p_M reaches that is shorter than this and does not cross the surface.
  ///
  /// Off the surface the winding number is smooth, and its gradient is an integral along the open
  /// edges alone, as the magnetic field is along a current (the law of Biot and Savart, for the
  /// solid angle of a surface). The gradient at p_M is summed up, and its derivative bounded by
  /// 2 length / (4 pi distance^3) of each edge.
  /// @param max_radius  [m] the result is no larger
  double steady_radius(const Eigen::Vector3d& p_M, double change, double max_radius) const;

  /// The sums at a place, which may be moved by its rounding().
  OpenEdgeSums sums(const Eigen::Vector3d& p_M) const;
  /// [m] How far float may move a place from the edges.
  double rounding(const Eigen::Vector3d& p_M) const;

 private:
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  // [m] mesh frame
  double extent_ = 0.0;                               // [m] of the edges about the origin
  std::vector<OpenEdgeBlock> blocks_;
  std::vector<OpenEdgeNode> nodes_;  // the root is the last one
};

/// The SIMD kernel of OpenEdgeHierarchy::sums().
/// @param nodes   not empty; the root is the last one
/// @param p       [m] a place, from the origin of the hierarchy
void sum_open_edges(const std::vector<OpenEdgeNode>& nodes,
                    const std::vector<OpenEdgeBlock>& blocks, const float* p, OpenEdgeSums* sums);

}  // namespace ist
