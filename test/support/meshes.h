#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>

#include "ist_proximity/geometry/shapes.h"

/// Simple meshes. Triangles are counter-clockwise seen from outside; meshes are closed unless their
/// comment says otherwise.
namespace ist::test {

TriangleMesh box(const Eigen::Vector3d& size);

/// 20 * 4^subdivisions faces with all vertices on the sphere (at most 5 subdivisions).
TriangleMesh icosphere(double radius, int subdivisions);

/// Torus about z: tube of radius `minor` around a circle of radius `major`, vertices on the tube.
TriangleMesh torus(double major, double minor, int around, int across);

/// A box without its top (+z): five faces of no thickness.
TriangleMesh open_box(const Eigen::Vector3d& size);

/// A closed plate in the xy plane.
TriangleMesh thin_plate(double side, double thickness);

/// A sheet without thickness or inside: two triangles in the xy plane, seen from +z.
TriangleMesh sheet(double side);

/// An L of two arms along +x and +y from the origin, `length` long and `width` wide and high
/// (z from 0 to `width`); concave along the edge x = y = width.
TriangleMesh l_shape(double length, double width);

/// The mesh transformed by X.
TriangleMesh moved(TriangleMesh mesh, const Eigen::Isometry3d& X);

/// The triangles of both meshes in one.
TriangleMesh joined(TriangleMesh mesh, const TriangleMesh& other);

/// The mesh with the orientation of all triangles reversed.
TriangleMesh inside_out(TriangleMesh mesh);

Eigen::AlignedBox3d bounds(const TriangleMesh& mesh);

/// [m^2]
double surface_area(const TriangleMesh& mesh);

/// [m^3] enclosed by a closed mesh; negative when it is inside out.
double signed_volume(const TriangleMesh& mesh);

/// The number of edges that do not belong to exactly two triangles, once in each direction; 0 if
/// the mesh is closed.
std::size_t open_edges(const TriangleMesh& mesh);

}  // namespace ist::test
