#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <random>
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
  Eigen::Map<Eigen::Vector3f> at(std::size_t i) {
    return Eigen::Map<Eigen::Vector3f>(&data[4 * i]);
  }
  Eigen::Vector3d point(std::size_t i) const {
    return Eigen::Map<const Eigen::Vector3f>(&data[4 * i]).cast<double>();
  }
  /// Tiles may be read from it when a query looks at them: the image must outlive the snapshot.
  RawCloud raw() const {
    RawCloud cloud = packed_cloud(data.data(), width, height, 4);
    cloud.owner = std::shared_ptr<const void>(std::shared_ptr<void>(), data.data());
    return cloud;
  }
};

/// A wall 1 m in front of the camera, with a step, and noise [m] along its axis.
inline Image wall(std::size_t width, std::size_t height, double noise, Rng* rng) {
  Image image{width, height, std::vector<float>(4 * width * height)};
  std::normal_distribution<double> normal(0.0, noise > 0.0 ? noise : 1.0);
  for (std::size_t i = 0; i < width * height; ++i) {
    const double u = static_cast<double>(i % width) / static_cast<double>(width) - 0.5;
    const double v = static_cast<double>(i / width) / static_cast<double>(width) - 0.5;
    const double depth = (u < 0.1 ? 1.0 : 1.2) + (noise > 0.0 ? normal(*rng) : 0.0);
    image.at(i) = (depth * Eigen::Vector3d(u, v, 1.0)).cast<float>();
  }
  return image;
}

}  // namespace ist::test
