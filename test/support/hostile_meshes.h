#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

/// Faulty meshes of the kinds that occur in practice, made by code.
namespace ist::test {

struct HostileMesh {
  std::string name;
  TriangleMesh mesh;
  double max_error;        ///< [m] of its packing
  std::string fault = {};  ///< a part of the error that refuses it; nothing: it is packed
};

TriangleMesh scaled(TriangleMesh mesh, double scale);

TriangleMesh shifted(TriangleMesh mesh, const Eigen::Vector3d& by);

/// The mesh without every n-th triangle.
TriangleMesh perforated(TriangleMesh mesh, std::size_t n);

/// The mesh with every n-th triangle's orientation reversed.
TriangleMesh partly_flipped(TriangleMesh mesh, std::size_t n);

/// The mesh with vertices at the same place merged, as load_mesh does; triangles keep their order.
TriangleMesh merged(const TriangleMesh& mesh);

/// A Moebius strip of `count` quads.
TriangleMesh moebius_strip(double radius, double width, int count);

/// A box without its two ends (+-z): four faces of no thickness.
TriangleMesh tube(const Eigen::Vector3d& size);

std::vector<HostileMesh> hostile_meshes();

}  // namespace ist::test
