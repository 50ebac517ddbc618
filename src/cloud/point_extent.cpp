#include "ist_proximity/cloud/point_extent.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "internal/geometry/numbers.h"
#include "ist_proximity/cloud/ingest.h"

namespace ist {
namespace {

using Footprint = ExtentConfig::Footprint;

// A patch between four pixels: no point of it is farther from the nearest of them than half its
// diagonal, which is longest where the surface is inclined along it.
double patch_radius(double incidence) { return std::sqrt(0.5) / std::cos(incidence); }

struct Limit {
  const char* member;
  double value, largest;
  const char* unit;
};

}  // namespace

// A number that is negative or NaN is not zero, so that check_extent() refuses it.
bool ExtentConfig::is_zero() const {
  const bool has_noise = sigmas != 0.0 && (noise_constant != 0.0 || noise_quadratic != 0.0);
  const bool has_footprint = footprint == Footprint::kCamera ||
                             (footprint == Footprint::kRadius && footprint_radius != 0.0) ||
                             (footprint == Footprint::kAngle && footprint_angle != 0.0);
  return !has_noise && !has_footprint && calibration == 0.0 && calibration_angle == 0.0 &&
         !(latency != 0.0 && speed != 0.0);
}

std::string check_extent(const ExtentConfig& config, double max_range) {
  const Limit limits[] = {{"noise_constant", config.noise_constant, 1.0, "m"},
                          {"noise_quadratic", config.noise_quadratic, 1.0, "1/m"},
                          {"sigmas", config.sigmas, 10.0, ""},
                          {"calibration", config.calibration, 1.0, "m"},
                          {"calibration_angle", config.calibration_angle, 0.5, "rad"},
                          {"footprint_radius", config.footprint_radius, 1.0, "m"},
                          {"footprint_angle", config.footprint_angle, 0.5, "rad"},
                          {"field_of_view", config.field_of_view, 2.0 * kPi, "rad"},
                          {"incidence", config.incidence, 1.5, "rad"},
                          {"latency", config.latency, 10.0, "s"},
                          {"speed", config.speed, 20.0, "m/s"}};
  std::ostringstream text;
  for (const Limit& limit : limits) {
    if (limit.value >= 0.0 && limit.value <= limit.largest) continue;
    text << limit.member << " is " << limit.value << ' ' << limit.unit << ": it must be from 0 to "
         << limit.largest << ' ' << limit.unit;
    return text.str();
  }
  // The footprint of a camera that is not known yet adds little to this.
  const PointExtent extent = point_extent(config, 0.0, max_range);
  if (extent.linear == 0.0 && extent.quadratic == 0.0) {
    if (extent.constant <= kMaxExtent) return "";
    text << "the points' radius is " << extent.constant << " m: allowed are at most " << kMaxExtent
         << " m";
    return text.str();
  }
  if (extent.radius(max_range) <= kMaxExtent && extent.growth(max_range) <= kMaxExtentGrowth) {
    return "";
  }
  text << "the radius of a point at max_range, " << max_range << " m, is "
       << extent.radius(max_range) << " m: allowed are at most " << kMaxExtent
       << " m, and a growth of at most " << kMaxExtentGrowth
       << " m for each metre of range; lower max_range or the noise";
  return text.str();
}

PointExtent point_extent(const ExtentConfig& config, double pixel_angle, double max_range) {
  PointExtent extent;
  extent.max_range = max_range;
  extent.constant =
      config.sigmas * config.noise_constant + config.calibration + config.latency * config.speed;
  extent.linear = config.calibration_angle;
  extent.quadratic = config.sigmas * config.noise_quadratic;
  switch (config.footprint) {
    case Footprint::kNone:
      break;
    case Footprint::kRadius:
      extent.constant += config.footprint_radius;
      break;
    case Footprint::kAngle:
      extent.linear += config.footprint_angle * patch_radius(config.incidence);
      break;
    case Footprint::kCamera:
      extent.linear += pixel_angle * patch_radius(config.incidence);
      break;
  }
  return extent;
}

void PointExtent::allow_for(double movement) {
  max_range += movement;
  if (linear == 0.0 && quadratic == 0.0) return;
  constant += movement * growth(max_range);
}

double pixel_angle(const RawCloud& cloud, double field_of_view) {
  if (cloud.pixel_angle > 0.0) return cloud.pixel_angle;
  // Pixels lie evenly on the image plane, so that the angle is largest in the middle.
  const bool is_image = cloud.width > 1 && cloud.height > 1;
  if (is_image && field_of_view > 0.0 && field_of_view < kPi) {
    return 2.0 * std::tan(0.5 * field_of_view) / static_cast<double>(cloud.width - 1);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

}  // namespace ist
