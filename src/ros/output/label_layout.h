#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace ist {

/// A label that is to be placed.
struct Label {
  std::size_t id = 0;                                  ///< for the caller
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< [m] wanted; afterwards: its place
};

/// Places labels so that none lies over another: each gets a height of its own, so that their rows
/// do not cross in a view from the side, wherever the viewer stands. A label whose row is taken
/// moves up or down to the nearest free one; it is left out where that is too far.
/// @param labels   the most important first
/// @param row      [m] height of a row
/// @param farthest [m] that a label may be moved
/// @returns those that are shown, in the same order
std::vector<Label> place_labels(const std::vector<Label>& labels, double row, double farthest);

}  // namespace ist
