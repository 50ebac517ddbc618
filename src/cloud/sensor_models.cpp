// Noise of common sensors, as published; doc/sources.md quotes the sources.

#include <algorithm>
#include <cmath>

#include "ist_proximity/cloud/point_extent.h"

namespace ist {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180.0;

// The ratio of range to depth at the corner of an image. Noise is published for depths, and moves a
// point along its ray.
double corner_ratio(double horizontal_fov, double vertical_fov) {
  return std::hypot(1.0, std::tan(0.5 * horizontal_fov), std::tan(0.5 * vertical_fov));
}

// Triangulation: an error of the disparity [pixels] makes one of depth^2 times this [1/m].
double triangulation(double disparity_error, double focal_length, double baseline) {
  return disparity_error / (focal_length * baseline);
}

std::vector<SensorModel> make_sensor_models() {
  const double kinect = corner_ratio(57.0 * kDegree, 43.0 * kDegree);
  const double d400 = corner_ratio(87.0 * kDegree, 58.0 * kDegree);
  const double azure = corner_ratio(75.0 * kDegree, 65.0 * kDegree);
  // A disparity error of 0.08 pixels at 848 pixels across 90 degrees; depths in steps of 1 mm.
  const double focal_length = 424.0, disparity_error = 0.08;
  const double step = 0.001 / std::sqrt(12.0);
  return {
      {"kinect_v1", 0.0012 * kinect, 0.0019, 0.0, 0.0, 57.0 * kDegree,
       "C. V. Nguyen, S. Izadi, D. Lovell: Modeling Kinect Sensor Noise for Improved 3D "
       "Reconstruction and Tracking. 3DIMPVT 2012"},
      {"realsense_d435", step * d400, triangulation(disparity_error, focal_length, 0.050), 0.0, 0.0,
       87.0 * kDegree,
       "A. Grunnet-Jepsen, J. Sweetser, J. Woodfill: Best-Known-Methods for Tuning Intel RealSense "
       "D400 Depth Cameras for Best Performance. Intel"},
      {"realsense_d455", step * d400, triangulation(disparity_error, focal_length, 0.095), 0.0, 0.0,
       87.0 * kDegree, "as realsense_d435, with its baseline of 95 mm"},
      {"azure_kinect", 0.017 * azure, 0.0, 0.011 * azure, 0.001, 75.0 * kDegree,
       "M. Tolgyessy, M. Dekan, L. Chovanec, P. Hubinsky: Evaluation of the Azure Kinect and Its "
       "Comparison to Kinect V1 and Kinect V2. Sensors 2021, 21(2), 413"}};
}

}  // namespace

const std::vector<SensorModel>& sensor_models() {
  static const std::vector<SensorModel> models = make_sensor_models();
  return models;
}

const SensorModel* find_sensor_model(const std::string& name) {
  const std::vector<SensorModel>& models = sensor_models();
  const auto found = std::find_if(models.begin(), models.end(),
                                  [&](const SensorModel& model) { return name == model.name; });
  return found == models.end() ? nullptr : &*found;
}

}  // namespace ist
