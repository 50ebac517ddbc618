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
  double min_depth = 0.15, max_depth = 2.5;                ///< [m] what is outside has no depth
  double noise = 0.005;  ///< [m] standard deviation of the depth, normally distributed
  /// Share of the pixels beside a jump in depth that report a depth between the two (flying
  /// pixels), as time-of-flight cameras do.
  double flying_pixels = 0.0;
  double period = 1.0 / 30.0;  ///< [s] between pictures
  double latency = 0.05;       ///< [s] from the picture to its arrival
};

/// Something in front of a camera.
struct Body {
  const RayShape* shape;
  Eigen::Isometry3d X_FS;  ///< shape's frame -> fixed frame
};

/// A pinhole depth camera: one exact ray per pixel, then noise. Pixels whose ray cannot meet a body
/// are left out by the body's bounding ball, and what does not move is seen once, at the start.
class DepthCamera {
 public:
  DepthCamera(const DepthCameraConfig& config, const std::vector<Body>& background);

  /// Row by row, [m] in the optical frame; NaN where there is no depth.
  /// @param bodies  what moves, besides the background
  std::vector<Eigen::Vector3f> picture(const std::vector<Body>& bodies, Rng* rng) const;

  const DepthCameraConfig& config() const { return config_; }
  /// Whether p_F is in the picture's frame and range (it may be hidden).
  bool has_in_view(const Eigen::Vector3d& p_F) const;

 private:
  Eigen::Vector3d ray(int column, int row) const;  // z = 1, so that a ray's parameter is the depth
  void draw(const Body& body, std::vector<double>* depth) const;
  void fly(Rng* rng, std::vector<double>* depth) const;

  DepthCameraConfig config_;
  std::vector<double> background_;  // [m] by pixel; inf: nothing
};

/// Pose of a camera at `eye` that has `target` in its middle and the horizon level.
Eigen::Isometry3d looking_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target);

}  // namespace ist::sim
