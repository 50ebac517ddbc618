#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <memory>
#include <string>

#include "internal/cloud/noise_filter.h"
#include "ist_proximity/cloud/depth_image.h"
#include "ros/input/measurement.h"

namespace ist {

/// The topic of the CameraInfo that belongs to an image by ROS' convention: `camera_info` beside
/// it.
/// @param image_topic  resolved
std::string sibling_camera_info(const std::string& image_topic);

/// The newest calibration of a source's camera. Not thread safe.
class DepthCamera {
 public:
  /// @param source  name of the source
  /// @param topic   resolved, of the CameraInfo
  DepthCamera(std::string source, std::string topic);

  void take(const sensor_msgs::CameraInfo& message);

  /// Why images cannot be used; empty when they can.
  /// @param frame_id  of the image
  std::string fault(const std::string& frame_id) const;
  /// A sentence about images that are used all the same: they may not be rectified. Else empty.
  const std::string& doubt() const { return doubt_; }
  const std::shared_ptr<const DepthRays>& rays() const { return rays_; }

 private:
  const std::string source_, topic_;
  sensor_msgs::CameraInfo newest_;
  bool has_come_ = false;
  std::string fault_, doubt_;
  std::shared_ptr<const DepthRays> rays_;
};

/// Reads a depth image.
/// @param unit        [m] as DepthImage::unit
/// @param max_points  an image of more pixels is faulty
/// @param noise       null: no noise filter
Received read_image(const sensor_msgs::ImageConstPtr& message, const DepthCamera& camera,
                    double unit, std::size_t max_points, const std::shared_ptr<NoiseFilter>& noise);

}  // namespace ist
