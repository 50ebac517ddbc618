#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace ist {

/// Indexed triangles in the frame M of the mesh, in metres. Counter-clockwise seen from outside;
/// need not be closed, manifold or consistently oriented (inside is decided by winding number).
struct TriangleMesh {
  using Triangle = std::array<std::uint32_t, 3>;

  std::vector<Eigen::Vector3d> vertices;
  std::vector<Triangle> triangles;

  const Eigen::Vector3d& corner(std::size_t triangle, int k) const {
    return vertices[triangles[triangle][static_cast<std::size_t>(k)]];
  }
};

}  // namespace ist
