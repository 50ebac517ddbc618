#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "ist_proximity/geometry/shapes.h"
#include "support/byte_reader.h"
#include "support/hard_shapes.h"
#include "support/meshes.h"

/// Small meshes, and points about them, from the bytes of a fuzz input.
namespace ist::fuzz {

/// A length from 1 um to 1 m.
inline double length(ByteReader* in) { return std::pow(10.0, in->between(-6.0, 0.0)); }

/// Triangles of any vertices: mostly open, crossing, of any orientation, without area now and then.
inline TriangleMesh triangles_from(ByteReader* in) {
  TriangleMesh mesh;
  const std::size_t vertices = 3 + in->below(6), triangles = 1 + in->below(24);
  const double size = length(in), flat = length(in);
  for (std::size_t i = 0; i < vertices; ++i) {
    const Eigen::Vector3d p = in->vector(1.0);
    mesh.vertices.push_back({size * p.x(), size * p.y(), size * flat * p.z()});
  }
  for (std::size_t i = 0; i < triangles; ++i) {
    TriangleMesh::Triangle triangle;
    for (std::uint32_t& v : triangle) v = static_cast<std::uint32_t>(in->below(vertices));
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

/// A closed prism over a triangle, sheared: a sliver where one length is far below another.
inline TriangleMesh prism_from(ByteReader* in) {
  const double a = length(in), b = length(in), c = length(in);
  const Eigen::Vector3d u(a, 0, 0), v(a * in->within(1.0), b, 0),
      w(a * in->within(0.5), b * in->within(0.5), c);
  const Eigen::Vector3d o = -(u + v + 1.5 * w) / 3.0;
  return {{o, o + u, o + v, o + w, o + u + w, o + v + w},
          {{0, 2, 1}, {3, 4, 5}, {0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}, {2, 0, 3}, {2, 3, 5}}};
}

inline TriangleMesh mesh_from(ByteReader* in) {
  const std::size_t kind = in->below(8);
  const auto sizes = [in] { return Eigen::Vector3d(length(in), length(in), length(in)); };
  TriangleMesh mesh;
  switch (kind) {
    case 0:
      mesh = triangles_from(in);
      break;
    case 1:
      mesh = prism_from(in);
      break;
    case 2:
      mesh = test::box(sizes());
      break;
    case 3:
      mesh = test::open_box(sizes());
      break;
    case 4:
      mesh = test::l_shape(length(in), 0.3 * length(in));
      break;
    case 5:
      mesh = test::needle(length(in), length(in));
      break;
    case 6: {
      mesh = test::icosphere(length(in), 0);
      for (Eigen::Vector3d& v : mesh.vertices) v *= in->between(0.2, 1.2);
      mesh.triangles.resize(mesh.triangles.size() - in->below(8));
      break;
    }
    default:
      mesh = test::sliver_plate(length(in), length(in), length(in),
                                1 + static_cast<int>(in->below(8)));
  }
  return test::moved(mesh, in->pose(1.0));
}

/// [m] The diagonal of the bounding box.
inline double extent(const TriangleMesh& mesh) {
  return mesh.triangles.empty() ? 0.0 : test::bounds(mesh).diagonal().norm();
}

/// A point about a mesh, often next to a face, an edge or a vertex.
inline Eigen::Vector3d point_near(const TriangleMesh& mesh, double size, ByteReader* in) {
  const std::uint8_t kind = in->byte();
  if (kind < 80) return test::bounds(mesh).center() + in->vector(2.0 * size);
  const std::size_t t = in->below(mesh.triangles.size());
  const double a = in->between(0.0, 1.0), b = kind < 120 ? 0.0 : in->between(0.0, 1.0 - a);
  const Eigen::Vector3d p = kind > 230
                                ? mesh.corner(t, 0)
                                : Eigen::Vector3d((1.0 - a - b) * mesh.corner(t, 0) +
                                                  a * mesh.corner(t, 1) + b * mesh.corner(t, 2));
  return p + size * std::pow(10.0, in->between(-9.0, 0.0)) * in->vector(1.0);
}

}  // namespace ist::fuzz
