#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <string>

#include "ist_proximity/geometry/shapes.h"

/// Limits of everything that comes from outside: URDFs, mesh files, attached objects.
namespace ist {

/// [m] The largest length, and the largest coordinate of a position. Robots are smaller, and maps
/// of outdoor robots too. At this limit float resolves 1 mm, and the squares and products that the
/// searches compute in float (of the sixth power of a length, for triangles) stay finite.
constexpr double kMaxLength = 1e4;

/// The largest factor by which a mesh may be scaled along an axis: it turns 1 m into kMaxLength.
constexpr double kMaxScale = 1e4;

/// The size of a mesh file [bytes], and the number of its triangles. A model holds about 300 bytes
/// for each triangle, and reading and ordering a million of them takes about two seconds.
constexpr std::size_t kMaxMeshFileSize = std::size_t{256} << 20U;
constexpr std::size_t kMaxTriangles = 2000000;

/// The text of a URDF [bytes]; its links, and as many joints; the collision or visual elements that
/// are read; the bytes of a name. Robots have up to some hundred links. A query holds 100 kB for
/// each link with geometry.
constexpr std::size_t kMaxDescriptionSize = std::size_t{64} << 20U;
constexpr std::size_t kMaxLinks = 5000;
constexpr std::size_t kMaxElements = 20000;
constexpr std::size_t kMaxNameSize = 256;

/// Why a string cannot be a name in messages and topics: empty, too long, a control character, no
/// UTF-8. Empty if it can.
std::string name_fault(const std::string& name);

/// Text from outside for a message: control characters, and bytes that are no UTF-8, become '?',
/// and it is cut where it is long.
std::string printable(const std::string& text);

/// "its size along x is 1e+300 m; allowed is more than 0 and at most 10000 m", or empty.
/// @param what  "its size along x"
std::string size_fault(const std::string& what, double value);

/// The same for a scale: finite, not 0 and at most kMaxScale.
std::string scale_fault(const Eigen::Vector3d& scale);

/// The same for a position [m].
/// @param what  "its origin"
std::string position_fault(const std::string& what, const Eigen::Vector3d& p);

/// The same for all numbers of an element: its sizes or corners, and its pose.
std::string element_fault(const GeometryElement& element);

/// The same for a shape. A mesh names its vertices; it may have no triangle.
std::string shape_fault(const Shape& shape);

}  // namespace ist
