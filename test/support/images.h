#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "support/scene.h"

/// Organized clouds for tests of what is kept from image to image.
namespace ist::test {

/// A message of some pixels; NaN where nothing was measured.
struct Image {
  std::size_t width = 0, height = 0;
  std::vector<float> data;

  std::size_t size() const { return width * height; }
  Eigen::Map<Eigen::Vector3f> at(std::size_t i);
  Eigen::Vector3d point(std::size_t i) const;
  /// Tiles may be read from it when a query looks at them: the image must outlive the snapshot.
  RawCloud raw() const;
};

/// A wall 1 m in front of the camera, with a step, and noise [m] along its axis.
Image wall(std::size_t width, std::size_t height, double noise, Rng* rng);

}  // namespace ist::test
