#pragma once

#include <Eigen/Core>

#include "ist_proximity/cloud/cloud_layout.h"

namespace ist {

/// Axes that most of a cloud's surfaces lie along. A box about a slanted surface is thick, and
/// queries pay for that.
///
/// Looks at normals here and there: the direction that most of them share, and then the one across
/// it that most of the others do, as in rooms and on tables; a matter of speed.
/// @param cloud  checked by check_layout
/// @param R_FS   sensor frame -> fixed frame
/// @param is_image  neighbours in the image are neighbours in space; else any order
/// @returns R_FO, a rotation: the axes as columns, in the order in which they come nearest to the
///          fixed frame's; those of the fixed frame, where surfaces share no direction
Eigen::Matrix3d scene_axes(const RawCloud& cloud, const Eigen::Matrix3d& R_FS, bool is_image);

}  // namespace ist
