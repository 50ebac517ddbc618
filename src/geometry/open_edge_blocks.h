#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// The open edges of a mesh in blocks of neighbours, for a bound of the gradient of its winding
/// number. Immutable; const members are thread safe and allocate nothing.
class OpenEdgeBlocks {
 public:
  OpenEdgeBlocks() = default;
  /// @throws Cancelled
  explicit OpenEdgeBlocks(const TriangleMesh& mesh, const CancelRequest& cancelled = {});

  /// [1/m] An upper bound of the gradient of the winding number within a ball that the surface does
  /// not enter; inf where an open edge may.
  double gradient_bound(const Eigen::Vector3d& p_M, double radius) const;

 private:
  struct Edge {
    Eigen::Vector3d from, to;  // [m]
    double length;             // [m] times the number of missing partners
  };
  struct Block {
    Eigen::Vector3d center;  // [m]
    double radius, length;   // [m]
    std::size_t first, last;
  };
  static constexpr std::size_t kEdges = 8;  // of a block

  std::vector<Edge> edges_;
  std::vector<Block> blocks_;
};

}  // namespace ist
