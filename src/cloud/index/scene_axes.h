#pragma once

#include <Eigen/Core>

#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// Finds axes along which most of a cloud's surfaces lie: the box around a slanted surface is
/// thick, and queries pay for that.
///
/// Samples normals: the first axis is the direction that most of them share, the second the
/// direction perpendicular to it that most of the others share, as in rooms and on tables. The
/// answer decides how fast queries are, not what they find.
/// @param cloud  checked by check_layout
/// @param R_FS   sensor frame -> fixed frame
/// @param is_organized  neighbouring pixels are neighbours in space; else the points have any order
/// @returns R_FO, a rotation: the axes as columns, in the order in which they come nearest to those
///          of the fixed frame; the identity where surfaces share no direction
Eigen::Matrix3d scene_axes(const RawCloud& cloud, const Eigen::Matrix3d& R_FS, bool is_organized);

}  // namespace ist
