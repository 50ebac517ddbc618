#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

namespace ist::sim {

struct Ray {
  Eigen::Vector3d origin, direction;  ///< the direction need not be of unit length
};

/// A shape for ray casting: primitives in closed form, meshes through a BVH of boxes. Immutable;
/// thread safe.
class RayShape {
 public:
  explicit RayShape(const Shape& shape);

  /// The smallest t > 0 at which origin + t * direction lies on the surface; inf if the ray misses.
  /// @param ray  in the shape's frame
  double hit(const Ray& ray) const;

  const Eigen::Vector3d& center() const { return center_; }  ///< [m] of a bounding sphere
  double radius() const { return radius_; }                  ///< [m] of that sphere

 private:
  struct Node {
    Eigen::Vector3d min, max;
    std::uint32_t first;  ///< leaf: its first triangle; else its second child (the first is next)
    std::uint32_t count;  ///< leaf: number of triangles; else 0
  };
  struct Triangle {
    Eigen::Vector3d a, ab, ac;
  };

  void build(const TriangleMesh& mesh);
  void build_node(std::vector<Triangle>* triangles, std::size_t begin, std::size_t end);
  double hit_mesh(const Ray& ray) const;

  Shape primitive_;          // an empty mesh if the shape is a mesh
  std::vector<Node> nodes_;  // of a mesh, depth first
  std::vector<Triangle> triangles_;
  Eigen::Vector3d center_ = Eigen::Vector3d::Zero();
  double radius_ = 0.0;
};

}  // namespace ist::sim
