#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/robot_model.h"

/// Robots, frames and configurations that the methods get.
namespace ist::benchmark {

/// A depth camera's message: x, y, z and padding, four floats a point, NaN for pixels without a
/// measurement.
struct Frame {
  std::size_t width = 0, height = 0;
  std::vector<float> data;
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();  ///< sensor -> fixed frame

  std::size_t bytes() const { return data.size() * sizeof(float); }
  RawCloud raw() const;
};

/// [1/m] A Kinect's noise along the ray, over the depth squared (Khoshelham and Elberink 2012).
constexpr double kKinectNoise = 1.425e-3;

/// The frame as the sensor's next image of a still scene: Gaussian noise along the ray, of standard
/// deviation noise * z^2.
/// @param noise  [1/m]
Frame next_image(const Frame& frame, double noise, std::mt19937_64* rng);

/// The finite points of a frame, in the fixed frame. Most methods start from them.
struct Points {
  std::vector<float> x, y, z;  ///< [m]

  std::size_t size() const { return x.size(); }
  Eigen::Vector3f at(std::size_t i) const { return {x[i], y[i], z[i]}; }
  /// Overwrites the points in one pass over the message's bytes; keeps the memory.
  void read(const Frame& frame);
};

struct Configuration {
  std::vector<Eigen::Isometry3d> X_FL;  ///< by link
  std::vector<double> distance;         ///< [m] truth: surface to cloud, unsigned
  std::vector<bool> is_contact;         ///< truth: points are inside
};

struct Scene {
  std::string name;
  Frame frame;
  std::vector<Configuration> configurations;
};

/// A robot as a list of meshes, packed on demand.
struct Robot {
  std::vector<TriangleMesh> meshes;  ///< by link, in the link's frame
  std::string cache_directory;

  /// Packed to `max_error` [m], at most `max_spheres` for each link.
  std::shared_ptr<const RobotModel> pack(double max_error, int max_spheres = 20000) const;
};

/// Spheres instead of the links, by link.
struct SphereSet {
  struct Sphere {
    Eigen::Vector3d center;  ///< [m] link frame
    double radius;           ///< [m]
  };
  std::vector<std::vector<Sphere>> links;
  double gap = 0.0;  ///< [m] no surface point is farther from the spheres
  std::size_t size() const;
};

/// Few inner spheres: the packing whose number of spheres comes nearest to `wanted`.
SphereSet few_spheres(const Robot& robot, std::size_t wanted);

struct DataSet {
  std::string name;
  Robot robot;
  std::vector<Scene> scenes;
  std::vector<std::vector<Eigen::Isometry3d>> motion;  ///< link poses, 1 ms apart
};

/// A Franka Panda among three Kinect frames, with exact truth.
DataSet kinect_data(const std::filesystem::path& data, const std::string& cache_directory);

/// Tori, spheres, boxes, cylinders and angles among a ray-traced scene, truth by brute force.
DataSet synthetic_data(const std::string& cache_directory);

/// The parts of the synthetic data. The frame shows a table, things on it and a wall behind, seen
/// by a camera at the table's edge.
Frame synthetic_frame(std::size_t width, std::size_t height);
std::vector<TriangleMesh> synthetic_meshes();
Eigen::Isometry3d synthetic_pose(std::mt19937_64* rng);

/// Interpolates `steps` poses for each pair of successive ones.
std::vector<std::vector<Eigen::Isometry3d>> interpolated(
    const std::vector<std::vector<Eigen::Isometry3d>>& poses, int steps);

}  // namespace ist::benchmark
