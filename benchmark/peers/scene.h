#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <filesystem>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/robot/robot_model.h"

/// Robots, frames and configurations that are measured with.
namespace ist::benchmark {

using Poses = std::vector<Eigen::Isometry3d>;  ///< X_FL by link

/// A depth camera's message: x, y, z and padding, four floats a point, NaN for pixels without a
/// measurement.
struct Frame {
  std::size_t width = 0, height = 0;
  std::vector<float> data;
  Eigen::Isometry3d X_FS = Eigen::Isometry3d::Identity();  ///< sensor -> fixed frame

  std::size_t size() const { return width * height; }
  /// [m] in the sensor frame
  Eigen::Map<const Eigen::Vector3f> point(std::size_t i) const {
    return Eigen::Map<const Eigen::Vector3f>(&data[4 * i]);
  }
  RawCloud raw() const;
};

Frame make_frame(const std::vector<Eigen::Vector3f>& points, const Eigen::Isometry3d& X_FS);

/// [1/m] A Kinect's noise along the ray, over the depth squared (Khoshelham and Elberink 2012).
constexpr double kKinectNoise = 1.425e-3;

/// The frame as the sensor's next image of a still scene: Gaussian noise along the ray, of standard
/// deviation noise * z^2.
/// @param noise  [1/m]
Frame next_image(const Frame& frame, double noise, std::mt19937_64* rng);

/// Overwrites `points` by the finite points of a frame, in the fixed frame; keeps the memory.
void read_points(const Frame& frame, std::vector<Eigen::Vector3f>* points);

struct Configuration {
  Poses X_FL;
  std::vector<double> distance;  ///< [m] truth: surface to cloud, unsigned
  std::vector<bool> is_contact;  ///< truth: points are inside
};

struct Scene {
  std::string name;
  Frame frame;
  std::vector<Configuration> configurations;
};

/// A robot's model as the node has it, from the cache where it is there.
std::shared_ptr<const RobotModel> packed(const RobotDescription& robot,
                                         const std::string& cache_directory, double max_error);

/// A robot as a list of meshes, packed on demand.
struct Robot {
  std::vector<TriangleMesh> meshes;  ///< by link, in the link's frame
  std::string cache_directory;

  /// @param max_error  [m]
  std::shared_ptr<const RobotModel> pack(double max_error) const;
};

struct DataSet {
  std::string name;
  Robot robot;
  std::vector<Scene> scenes;
  std::vector<Poses> motion;  ///< 1 ms apart
};

/// A Franka Panda among three Kinect frames, with exact truth.
DataSet kinect_data(const std::filesystem::path& data, const std::string& cache_directory);

/// Tori, cylinders and the like above the synthetic frame's table, without contact; exact truth.
DataSet synthetic_data(const std::string& cache_directory);

/// The first poses of the Panda's recorded motion.
std::vector<Poses> recorded_motion(const std::filesystem::path& data, std::size_t count);

/// A table, things on it and a wall behind, seen by a camera at the table's edge.
Frame synthetic_frame();

/// Interpolates `steps` poses for each pair of successive ones.
std::vector<Poses> interpolated(const std::vector<Poses>& poses, int steps);

}  // namespace ist::benchmark
