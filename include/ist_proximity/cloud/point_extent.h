#pragma once

#include <Eigen/Core>
#include <limits>
#include <string>
#include <vector>

namespace ist {

/// The extent of a cloud's points: each point stands for a sphere, whose radius grows with the
/// distance from the sensor. The spheres hold the surface between neighbouring points, and the
/// measured surface in spite of noise, calibration and latency.
struct PointExtent {
  double constant = 0.0;   ///< [m] >= 0
  double linear = 0.0;     ///< [rad] radius for each metre of range, >= 0
  double quadratic = 0.0;  ///< [1/m] radius for each metre of range squared, >= 0
  /// [m] No point is farther from the sensor; at this range the radius grows by no more than
  /// kMaxExtentGrowth a metre.
  double max_range = std::numeric_limits<double>::infinity();
  Eigen::Vector3d p_FS = Eigen::Vector3d::Zero();  ///< [m] the sensor, in the fixed frame

  /// Whether points are points.
  bool is_zero() const { return constant == 0.0 && linear == 0.0 && quadratic == 0.0; }
  /// [m] The radius of a point at this range [m]. It never falls with the range.
  double radius(double range) const { return constant + range * (linear + range * quadratic); }
  /// The radius grows by so many metres for each metre at this range [m].
  double growth(double range) const { return linear + 2.0 * quadratic * range; }
  /// Allows for ranges that are off by this [m], because the sensor moved while it measured.
  void allow_for(double movement);
};

/// A radius that grew as fast as the range, or faster, would have no limit at any distance from a
/// link.
constexpr double kMaxExtentGrowth = 0.5;
/// [m] Largest radius of a point.
constexpr double kMaxExtent = 1.0;

/// The sources of a point's extent. By default there are none.
struct ExtentConfig {
  /// @name Noise
  /// The standard deviation of a measured range is noise_constant + noise_quadratic * range^2;
  /// `sigmas` of them go into the radius.
  ///@{
  double noise_constant = 0.0;   ///< [m] >= 0
  double noise_quadratic = 0.0;  ///< [1/m] >= 0
  double sigmas = 3.0;           ///< >= 0
  ///@}
  double calibration = 0.0;  ///< [m] >= 0: error of the sensor's position, and of its ranges
  double calibration_angle =
      0.0;  ///< [rad] >= 0: error of its orientation; of its ranges, by ratio

  /// The surface between neighbouring points belongs to them.
  enum class Footprint {
    kNone,
    kRadius,  ///< footprint_radius, whatever the range
    kAngle,   ///< by the angle between two pixels
    kCamera   ///< by the angle that follows from the message, see pixel_angle()
  };
  Footprint footprint = Footprint::kNone;  ///< how wide a point is
  double footprint_radius = 0.0;           ///< [m] >= 0
  double footprint_angle = 0.0;            ///< [rad] >= 0: between two pixels
  /// [rad] the sensor's field of view along a row, for kCamera where no CameraInfo is; 0: unknown
  double field_of_view = 0.0;
  /// [rad] The surface is inclined by no more than this against the plane across the ray; below
  /// pi/2.
  double incidence = 1.0472;

  /// [m] No point is farther from where it was measured; inf: that is IngestConfig::max_range.
  double max_range = std::numeric_limits<double>::infinity();

  double latency = 0.0;  ///< [s] >= 0: from the measurement to the stamp of its message
  double speed = 1.6;    ///< [m/s] >= 0: of what moves; a walking person's (ISO 13855)

  /// Whether it asks for anything.
  bool is_zero() const;
};

/// @returns an empty string, or one sentence with the member that is out of its range and its value
std::string check_extent(const ExtentConfig& config, double max_range);

/// The extent of the points of a cloud; p_FS is left at zero.
/// @param config       checked by check_extent()
/// @param pixel_angle  [rad] between two pixels; used where the footprint follows from the camera
/// @param max_range    [m] no point is farther
PointExtent point_extent(const ExtentConfig& config, double pixel_angle, double max_range);

struct RawCloud;

/// [rad] The largest angle between two neighbouring points: of a depth image from its rays, of a
/// scan from its increment, of an organized cloud from the field of view; NaN where neither is
/// known.
double pixel_angle(const RawCloud& cloud, double field_of_view);

/// A depth camera or scanner whose noise has been published.
struct SensorModel {
  const char* name;          ///< as the configuration names it
  double noise_constant;     ///< [m] see ExtentConfig
  double noise_quadratic;    ///< [1/m]
  double calibration;        ///< [m]
  double calibration_angle;  ///< [rad]
  double field_of_view;      ///< [rad] along a row; 0: depends on the sensor's mode
  const char* origin;        ///< where the numbers were published
};

/// The sensors that are known by name; doc/sources.md says where their numbers are from.
const std::vector<SensorModel>& sensor_models();
/// Null: there is none of this name.
const SensorModel* find_sensor_model(const std::string& name);

}  // namespace ist
