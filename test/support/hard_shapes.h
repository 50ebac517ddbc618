#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>

#include "ist_proximity/geometry/shapes.h"

/// Meshes that are hard for geometry code.
namespace ist::test {

/// Collects triangles given by their corners; equal corners become one vertex.
class MeshBuilder {
 public:
  using Point = Eigen::Vector3d;

  void triangle(const Point& a, const Point& b, const Point& c);
  void quad(const Point& a, const Point& b, const Point& c, const Point& d);
  const TriangleMesh& mesh() const { return mesh_; }

 private:
  std::uint32_t vertex(const Point& p);

  TriangleMesh mesh_;
  std::map<std::array<double, 3>, std::uint32_t> vertices_;
};

/// Chazelle's polyhedron (1984): a block with `notches` wedges cut into its top along x and as many
/// into its bottom along y. The wedges' edges are rulings of the saddle z = x y, `gap` [m] apart,
/// so that it falls into no fewer than about notches^2 convex parts. `size` [m] wide.
TriangleMesh chazelle(int notches, double gap, double size);

/// A plate in the xy plane whose faces are `strips` slivers along x.
TriangleMesh sliver_plate(double length, double width, double thickness, int strips);

/// A four-sided spike along z with its tip at the origin.
TriangleMesh needle(double length, double radius);

}  // namespace ist::test
