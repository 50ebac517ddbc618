#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "ist_proximity/geometry/shapes.h"

/// The hard cases as scenes, for the table in doc/accuracy.md. Each has a test of its own, too.
namespace ist::test {

struct HardScene {
  std::string name;
  std::vector<LinkGeometry> links;
  std::vector<std::vector<Eigen::Vector3d>> clouds;  ///< [m] fixed frame
  Eigen::Vector3d far =
      Eigen::Vector3d::Zero();  ///< [m] links, clouds and origin are moved by this
};

std::vector<HardScene> hard_scenes();

}  // namespace ist::test
