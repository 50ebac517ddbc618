#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"

namespace ist {

/// The description that a depth image gives of its own bytes (the members of sensor_msgs/Image).
struct DepthImage {
  std::string encoding;                ///< "16UC1" or "mono16" [mm], "32FC1" [m]
  std::uint32_t width = 0;             ///< pixels in a row
  std::uint32_t height = 0;            ///< rows
  std::uint32_t step = 0;              ///< [bytes] from a row to the next
  bool is_bigendian = false;           ///< byte order of the numbers
  const std::uint8_t* data = nullptr;  ///< not owned
  std::size_t data_size = 0;           ///< [bytes]
  double unit = 0.0;                   ///< [m] that a number of 1 means; 0: that of the encoding
};

/// A pinhole camera (the members of sensor_msgs/CameraInfo).
struct CameraModel {
  std::uint32_t width = 0;         ///< [pixels] of the whole sensor
  std::uint32_t height = 0;        ///< [pixels] of the whole sensor
  std::array<double, 9> K = {};    ///< row-major; used where P is all zero
  std::array<double, 12> P = {};   ///< row-major
  std::vector<double> D;           ///< distortion; images are taken for rectified
  std::uint32_t binning_x = 0;     ///< columns of the sensor in one of the image; 0 means 1
  std::uint32_t binning_y = 0;     ///< rows of the sensor in one of the image; 0 means 1
  std::uint32_t roi_x_offset = 0;  ///< [pixels] of the sensor, to the left of the image
  std::uint32_t roi_y_offset = 0;  ///< [pixels] of the sensor, above the image
  std::uint32_t roi_width = 0;     ///< [pixels] of the sensor; 0: the whole sensor
  std::uint32_t roi_height = 0;    ///< [pixels] of the sensor; 0: the whole sensor
};

/// The rays of an image's pixels: the pixel in column u and row v sees the points
/// (x[u] z, y[v] z, z) from its centre of projection, in the axes of the camera's optical frame
/// (REP 103: z forward, x right, y down).
struct DepthRays {
  std::vector<double> x;  ///< by column
  std::vector<double> y;  ///< by row
  /// [m] Centre of projection in the optical frame: (-P[3] / P[0], -P[7] / P[5], 0), so that P
  /// projects as sensor_msgs/CameraInfo states.
  Eigen::Vector3d center = Eigen::Vector3d::Zero();
};

/// Computes the rays, with image_geometry's convention of binning and region of interest: K and P
/// are those of the whole sensor. P is used, or K where all of P is zero.
///
/// Faulty are: a width or height of 0, or above 65535; a region of interest outside the sensor; a
/// focal length that is not positive; a number that is not finite; skew; an image whose pixels look
/// more than 89 degrees off its axis.
/// @param rays  set when the camera is valid, else unchanged
/// @returns an empty string, or one sentence with the faulty member and its value. Thread safe.
std::string check_camera(const CameraModel& camera, std::shared_ptr<const DepthRays>* rays);

/// Whether a coefficient of D is not 0: the image must have been rectified then.
bool is_distorted(const CameraModel& camera);

/// Checks a depth image against its camera: a known encoding, at least one pixel, the camera's
/// width and height, and sizes that agree with each other and with the data. Nothing overflows,
/// whatever the sizes.
///
/// The result is a cloud of one point a pixel, which Ingest takes: points are computed from depths
/// and rays, in double, when they are read. REP 117 and 118: 0, NaN, -inf and negative depths mean
/// that nothing is known of the pixel, and are NaN points. +inf means that nothing is in range, and
/// is an infinite point.
/// @param rays        as check_camera() makes them
/// @param cloud       filled when the image is valid, else unchanged
/// @param max_points  an image of more pixels is faulty
/// @returns an empty string, or one sentence with the faulty member and its value. Thread safe.
std::string check_depth_image(const DepthImage& image, const std::shared_ptr<const DepthRays>& rays,
                              RawCloud* cloud, std::size_t max_points = IngestConfig().max_points);

}  // namespace ist
