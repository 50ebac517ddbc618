#include "ros/parameters/extent_parameters.h"

#include <limits>
#include <map>
#include <vector>

namespace ist {
namespace {

using Footprint = ExtentConfig::Footprint;

// A published model of noise, by its name.
void read_sensor(ParameterReader* reader, const std::string& name, ExtentConfig* config) {
  std::vector<std::string> names = {"none"};
  for (const SensorModel& model : sensor_models()) names.emplace_back(model.name);
  std::string chosen = "none";
  reader->read_choice(name, names, &chosen);
  const SensorModel* model = find_sensor_model(chosen);
  if (model == nullptr) return;
  config->noise_constant = model->noise_constant;
  config->noise_quadratic = model->noise_quadratic;
  config->calibration = model->calibration;
  config->calibration_angle = model->calibration_angle;
  config->field_of_view = model->field_of_view;
}

void read_noise_model(ParameterReader* reader, const std::string& name, ExtentConfig* config) {
  if (!reader->has(name)) return;
  if (!reader->is_dictionary(name)) return read_sensor(reader, name, config);
  const std::string prefix = name + "/";
  if (reader->has(prefix + "sensor")) read_sensor(reader, prefix + "sensor", config);
  reader->read(prefix + "a", Range::non_negative("m", 1.0), &config->noise_constant);
  reader->read(prefix + "b", Range::non_negative("1/m", 1.0), &config->noise_quadratic);
  reader->read(prefix + "k", Range::non_negative("", 10.0), &config->sigmas);
  reader->read(prefix + "calibration", Range::non_negative("m", 1.0), &config->calibration);
  reader->read(prefix + "calibration_angle", Range::non_negative("rad", 0.5),
               &config->calibration_angle);
}

void read_footprint(ParameterReader* reader, const std::string& name, ExtentConfig* config) {
  if (!reader->has(name)) return;
  const Range angle = Range::non_negative("rad", 0.5);
  if (reader->is_text(name)) {
    std::string chosen = "none";
    reader->read_choice(name, {"none", "camera"}, &chosen);
    config->footprint = chosen == "camera" ? Footprint::kCamera : Footprint::kNone;
    return;
  }
  if (!reader->is_dictionary(name)) {
    reader->read(name, angle, &config->footprint_angle);
    config->footprint = Footprint::kAngle;
    return;
  }
  const std::string prefix = name + "/";
  double field_of_view = 0.0;
  const bool has_radius = reader->has(prefix + "radius"), has_angle = reader->has(prefix + "angle");
  reader->read(prefix + "radius", Range::non_negative("m", 1.0), &config->footprint_radius);
  reader->read(prefix + "angle", angle, &config->footprint_angle);
  reader->read(prefix + "field_of_view", Range::non_negative("rad", 3.0), &field_of_view);
  if (field_of_view > 0.0) config->field_of_view = field_of_view;
  reader->read(prefix + "incidence", Range::non_negative("rad", 1.5), &config->incidence);
  config->footprint = has_radius  ? Footprint::kRadius
                      : has_angle ? Footprint::kAngle
                                  : Footprint::kCamera;
  if (has_radius && has_angle) {
    reader->add_error("~" + prefix + "radius and ~" + prefix + "angle are both set: one is needed");
  }
}

void read_latency(ParameterReader* reader, const std::string& name, ExtentConfig* config) {
  const Range time = Range::non_negative("s", 10.0);
  if (!reader->has(name)) return;
  if (!reader->is_dictionary(name)) return reader->read(name, time, &config->latency);
  reader->read(name + "/time", time, &config->latency);
  reader->read(name + "/speed", Range::non_negative("m/s", 20.0), &config->speed);
}

}  // namespace

void read_extent(ParameterReader* reader, const std::string& prefix, ExtentConfig* config) {
  read_noise_model(reader, prefix + "noise", config);
  read_footprint(reader, prefix + "footprint", config);
  read_latency(reader, prefix + "latency", config);
}

void require_extent(ParameterReader* reader, const std::string& prefix, double max_range,
                    ExtentConfig* config) {
  if (config->is_zero()) return;
  const std::string fault = check_extent(*config, max_range);
  if (fault.empty()) return;
  reader->add_error("~" + prefix + "noise, footprint and latency: " + fault);
  *config = ExtentConfig();
}

void require_map_extent(ParameterReader* reader, const std::string& prefix, ExtentConfig* config) {
  if (config->is_zero()) return;
  const PointExtent extent = point_extent(*config, 0.0, std::numeric_limits<double>::infinity());
  if (extent.linear > 0.0 || extent.quadratic > 0.0 || config->footprint == Footprint::kCamera) {
    reader->add_error("~" + prefix +
                      "noise and footprint grow with the range, but a map has no sensor from which "
                      "ranges count: noise/a, noise/k, noise/calibration, footprint/radius and "
                      "latency are for maps");
    *config = ExtentConfig();
    return;
  }
  require_extent(reader, prefix, std::numeric_limits<double>::infinity(), config);
}

}  // namespace ist
