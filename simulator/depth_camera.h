#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <random>
#include <string>
#include <vector>

#include "ray_shape.h"

namespace ist::sim {

using Rng = std::mt19937_64;

struct DepthCameraConfig {
  std::string name = "camera";
  Eigen::Isometry3d X_FC = Eigen::Isometry3d::Identity();  ///< optical frame (z forward) -> fixed
  int width = 160, height = 120;                           ///< pixels
  double focal_length = 135.0;                             ///< pixels
  double min_depth = 0.15, max_depth = 2.5;                ///< [m] NaN outside this range
  double noise = 0.005;  ///< [m] standard deviation of the depth, normally distributed
  /// Share of the pixels at a depth discontinuity that report a depth in between (flying pixels),
  /// as time-of-flight cameras do.
  double flying_pixels = 0.0;
  double period = 1.0 / 30.0;  ///< [s] between images
  double latency = 0.05;       ///< [s] from an image's stamp to its arrival
};

/// A shape in front of a camera.
struct Body {
  const RayShape* shape;
  Eigen::Isometry3d X_FS;  ///< shape's frame -> fixed frame
};

/// A pinhole depth camera: one exact ray per pixel, then noise. Each body is drawn in the pixels of
/// its bounding sphere only, and the background is drawn once, at the start.
class DepthCamera {
 public:
  DepthCamera(const DepthCameraConfig& config, const std::vector<Body>& background);

  /// Takes an image: points row by row, [m] in the optical frame; NaN where there is no depth.
  /// @param bodies  the moving bodies in front of the background
  std::vector<Eigen::Vector3f> picture(const std::vector<Body>& bodies, Rng* rng) const;

  const DepthCameraConfig& config() const { return config_; }
  /// Whether p_F is in the field of view and range; it may be occluded.
  bool has_in_view(const Eigen::Vector3d& p_F) const;

 private:
  Eigen::Vector3d ray(int column, int row) const;  // z = 1, so that a ray's parameter is the depth
  void draw(const Body& body, std::vector<double>* depth) const;
  void fly(Rng* rng, std::vector<double>* depth) const;

  DepthCameraConfig config_;
  std::vector<double> background_;  // [m] by pixel; inf: nothing
};

/// Pose X_FC of a camera at `eye` that has `target` at its image centre and a level horizon.
Eigen::Isometry3d looking_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

}  // namespace ist::sim
