#include <ros/console.h>

#include <algorithm>
#include <utility>

#include "ros/common/frame_name.h"
#include "ros/input/measurement.h"

namespace ist {
namespace {

CameraModel camera_model(const sensor_msgs::CameraInfo& message) {
  CameraModel camera;
  camera.width = message.width;
  camera.height = message.height;
  std::copy(message.K.begin(), message.K.end(), camera.K.begin());
  std::copy(message.P.begin(), message.P.end(), camera.P.begin());
  camera.D = message.D;
  camera.binning_x = message.binning_x;
  camera.binning_y = message.binning_y;
  camera.roi_x_offset = message.roi.x_offset;
  camera.roi_y_offset = message.roi.y_offset;
  camera.roi_width = message.roi.width;
  camera.roi_height = message.roi.height;
  return camera;
}

}  // namespace

void DepthCamera::take(const sensor_msgs::CameraInfo& message) {
  newest_.header = message.header;
  if (has_come_ && newest_ == message) return;  // but numbers that are NaN are checked again
  newest_ = message;
  has_come_ = true;
  const CameraModel camera = camera_model(message);
  rays_.reset();
  fault_ = check_camera(camera, &rays_);
  const std::string doubt =
      is_distorted(camera)
          ? "the camera_info on " + topic_ +
                " has distortion coefficients (D): depth images are taken for rectified, so that "
                "points are off where they are not; use a rectified topic (image_rect)"
          : "";
  if (!doubt.empty() && doubt_.empty()) {
    ROS_WARN_STREAM("source '" << config_.name << "': " << doubt);
  }
  doubt_ = doubt;
}

/// Why images cannot be used; empty when they can.
std::string DepthCamera::fault(const std::string& frame_id) const {
  if (!has_come_) {
    return "no sensor_msgs/CameraInfo has come on " + topic_ + "; set ~sources/" + config_.name +
           "/camera_info to its topic";
  }
  if (!fault_.empty()) return "malformed camera_info on " + topic_ + ": " + fault_;
  const std::string frame = without_slash(newest_.header.frame_id);
  if (!frame.empty() && frame != without_slash(frame_id)) {
    return "its images are in the frame '" + frame_id + "', the camera_info on " + topic_ +
           " is of '" + newest_.header.frame_id.substr(0, 256) + "': is it another camera's?";
  }
  return "";
}

Measurement DepthCamera::read(const sensor_msgs::ImageConstPtr& message) const {
  const std_msgs::Header& header = message->header;
  std::string fault = this->fault(header.frame_id);
  if (!fault.empty()) return faulty(header, fault);
  DepthImage image;
  image.encoding = message->encoding;
  image.width = message->width;
  image.height = message->height;
  image.step = message->step;
  image.is_bigendian = message->is_bigendian != 0;
  image.data = message->data.data();
  image.data_size = message->data.size();
  image.unit = config_.depth_unit;
  RawCloud raw;
  fault = check_depth_image(image, rays_, &raw);
  if (!fault.empty()) return faulty(header, "malformed image: " + fault);
  raw.owner = std::shared_ptr<const void>(message.get(), [message](const void*) {});
  Measurement measurement = measure_points(header, raw, message->data.size(), noise_);
  measurement.doubt = doubt_;
  return measurement;
}

}  // namespace ist
