#pragma once

#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "link_pairs/robot.h"

namespace ist::benchmark {

/// FCL: the distance [m] of a pair's triangles, at X_FL by link. It begins each query anew.
std::function<double(const LinkPair&, const std::vector<Eigen::Isometry3d>&)> fcl_distances(
    const Robot& robot);

}  // namespace ist::benchmark
