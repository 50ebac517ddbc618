#include "extent_class.h"

#include <string>

namespace ist::python {
namespace {

namespace py = pybind11;

using Footprint = ExtentConfig::Footprint;

constexpr const char* kExtentDoc =
    R"(How large the points of a sensor are, see doc/sources.md. Each point stands for a sphere, and
lower_bound holds for the spheres. distance and the closest points stay those of the points.

sensor: a name of Extent.sensors, whose published noise is used. Numbers that are given replace
  its numbers.
noise_constant [m], noise_quadratic [1/m]: the standard deviation of a range r is
  noise_constant + noise_quadratic * r^2; `sigmas` of them belong to a point.
calibration [m], calibration_angle [rad]: error of the sensor's pose.
footprint_radius [m], footprint_angle [rad, between two pixels] or field_of_view [rad, of a row of
  an image (h, w, 3)]: the surface between the points belongs to them. At most one of the three.
incidence [rad]: surfaces are inclined by no more than this.
latency [s], speed [m/s]: what moves may be so far from where it was measured.

Where the radius grows with the range, Obstacles needs a finite max_range.)";

/// An argument that may be left out.
void replace(const py::object& given, double* value) {
  if (!given.is_none()) *value = py::cast<double>(given);
}

ExtentConfig of_sensor(const py::object& name) {
  ExtentConfig config;
  if (name.is_none()) return config;
  const auto text = py::cast<std::string>(name);
  const SensorModel* model = find_sensor_model(text);
  if (model == nullptr) {
    std::string known;
    for (const SensorModel& one : sensor_models()) known += std::string(" ") + one.name;
    throw py::value_error("there is no sensor '" + text + "'; there are:" + known);
  }
  config.noise_constant = model->noise_constant;
  config.noise_quadratic = model->noise_quadratic;
  config.calibration = model->calibration;
  config.calibration_angle = model->calibration_angle;
  return config;
}

ExtentConfig make_extent(const py::object& sensor, const py::object& noise_constant,
                         const py::object& noise_quadratic, double sigmas,
                         const py::object& calibration, const py::object& calibration_angle,
                         const py::object& footprint_radius, const py::object& footprint_angle,
                         const py::object& field_of_view, double incidence, double latency,
                         double speed) {
  ExtentConfig config = of_sensor(sensor);
  replace(noise_constant, &config.noise_constant);
  replace(noise_quadratic, &config.noise_quadratic);
  replace(calibration, &config.calibration);
  replace(calibration_angle, &config.calibration_angle);
  replace(footprint_radius, &config.footprint_radius);
  replace(footprint_angle, &config.footprint_angle);
  replace(field_of_view, &config.field_of_view);
  config.sigmas = sigmas;
  config.incidence = incidence;
  config.latency = latency;
  config.speed = speed;
  const bool radius = !footprint_radius.is_none(), angle = !footprint_angle.is_none(),
             camera = !field_of_view.is_none();
  if (radius + angle + camera > 1) {
    throw py::value_error(
        "footprint_radius, footprint_angle and field_of_view say the same thing: give one of them");
  }
  config.footprint = radius   ? Footprint::kRadius
                     : angle  ? Footprint::kAngle
                     : camera ? Footprint::kCamera
                              : Footprint::kNone;
  return config;
}

py::list names() {
  py::list result;
  for (const SensorModel& one : sensor_models()) result.append(one.name);
  return result;
}

}  // namespace

ExtentConfig to_extent(const py::object& extent) {
  if (py::isinstance<ExtentConfig>(extent)) return py::cast<ExtentConfig>(extent);
  ExtentConfig config;
  try {
    config.footprint_radius = py::cast<double>(extent);
  } catch (const py::cast_error&) {
    throw py::type_error("extent is an Extent, or a radius [m]; a " +
                         std::string(py::str(py::type::of(extent).attr("__name__"))) +
                         " was given");
  }
  config.footprint = Footprint::kRadius;
  return config;
}

void define_extent(py::module_* module) {
  const ExtentConfig defaults;
  const py::none none;
  py::class_<ExtentConfig>(*module, "Extent", kExtentDoc)
      .def(py::init(&make_extent), py::arg("sensor") = none, py::kw_only(),
           py::arg("noise_constant") = none, py::arg("noise_quadratic") = none,
           py::arg("sigmas") = defaults.sigmas, py::arg("calibration") = none,
           py::arg("calibration_angle") = none, py::arg("footprint_radius") = none,
           py::arg("footprint_angle") = none, py::arg("field_of_view") = none,
           py::arg("incidence") = defaults.incidence, py::arg("latency") = defaults.latency,
           py::arg("speed") = defaults.speed)
      .def_property_readonly_static(
          "sensors", [](const py::object&) { return names(); }, "Names of sensors that are known")
      .def_readonly("noise_constant", &ExtentConfig::noise_constant)
      .def_readonly("noise_quadratic", &ExtentConfig::noise_quadratic)
      .def_readonly("sigmas", &ExtentConfig::sigmas)
      .def_readonly("calibration", &ExtentConfig::calibration)
      .def_readonly("calibration_angle", &ExtentConfig::calibration_angle)
      .def_readonly("footprint_radius", &ExtentConfig::footprint_radius)
      .def_readonly("footprint_angle", &ExtentConfig::footprint_angle)
      .def_readonly("field_of_view", &ExtentConfig::field_of_view)
      .def_readonly("incidence", &ExtentConfig::incidence)
      .def_readonly("latency", &ExtentConfig::latency)
      .def_readonly("speed", &ExtentConfig::speed)
      .def(py::pickle(
          [](const ExtentConfig& one) {
            return py::make_tuple(
                one.noise_constant, one.noise_quadratic, one.sigmas, one.calibration,
                one.calibration_angle, static_cast<int>(one.footprint), one.footprint_radius,
                one.footprint_angle, one.field_of_view, one.incidence, one.latency, one.speed);
          },
          [](const py::tuple& state) {
            ExtentConfig one;
            one.noise_constant = state[0].cast<double>();
            one.noise_quadratic = state[1].cast<double>();
            one.sigmas = state[2].cast<double>();
            one.calibration = state[3].cast<double>();
            one.calibration_angle = state[4].cast<double>();
            one.footprint = static_cast<Footprint>(state[5].cast<int>());
            one.footprint_radius = state[6].cast<double>();
            one.footprint_angle = state[7].cast<double>();
            one.field_of_view = state[8].cast<double>();
            one.incidence = state[9].cast<double>();
            one.latency = state[10].cast<double>();
            one.speed = state[11].cast<double>();
            return one;
          }));
}

}  // namespace ist::python
