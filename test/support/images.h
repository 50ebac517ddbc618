#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <vector>

#include "ist_proximity/cloud/depth_image.h"
#include "ist_proximity/cloud/ingest.h"
#include "support/scene.h"

/// Organized clouds and depth images.
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

/// @throws std::invalid_argument where the library refuses the camera or the image
std::shared_ptr<const DepthRays> rays_of(const CameraModel& camera);
/// An image of depths [m], which must outlive the snapshot, too.
RawCloud depth_cloud(const std::shared_ptr<const DepthRays>& rays, Span<const float> depths);

}  // namespace ist::test
