#pragma once

#include <cstddef>
#include <memory>

#include "ist_proximity/robot/robot_model.h"

namespace ist::test {

/// The model with a distance field of every link.
/// @param coarse  one in so many links, from the first one on, has a coarse field; 0: none
std::shared_ptr<const RobotModel> with_fields(const std::shared_ptr<const RobotModel>& model,
                                              std::size_t coarse = 0);

}  // namespace ist::test
