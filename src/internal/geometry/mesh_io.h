#pragma once

#include <Eigen/Core>
#include <string>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/shapes.h"

namespace ist {

/// Reads the triangles of an STL, DAE or OBJ file, with assimp. PLY and OFF files are read too;
/// other formats are not.
///
/// Node transforms and the file's unit are applied; Collada's up-axis is ignored, as rviz does;
/// lines and points are dropped; vertices with the same coordinates are merged; triangles with a
/// NaN or infinite corner are an error. `scale` multiplies each axis; a mirroring scale flips the
/// triangles so that outside stays outside. Closed surfaces that are inside out are flipped
/// (orient_outward). Thread safe.
/// @param path   a file on disk
/// @param scale  dimensionless, not 0 and at most kMaxScale in any axis
/// @throws ModelError naming the file and what is wrong: missing, no regular file, empty, no mesh,
///         no triangle, beyond a limit of limits.h (bytes, triangles, scale, coordinates).
/// @throws Cancelled
TriangleMesh load_mesh(const std::string& path,
                       const Eigen::Vector3d& scale = Eigen::Vector3d::Ones(),
                       const CancelRequest& cancelled = {});

}  // namespace ist
