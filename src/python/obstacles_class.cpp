#include "obstacles_class.h"

#include <limits>
#include <utility>

#include "arrays.h"
#include "ist_proximity/facade/robot.h"

namespace ist::python {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr const char* kDoc =
    R"(Points of obstacles, indexed for queries. Points that are not finite are dropped.

points: (n, 3) [m], a list; or (h, w, 3), an image with nan where nothing was measured, which is
  indexed several times faster; or the path of a PCD or PLY file. float32 stays float32.
sensor_pose: (4, 4), frame of the points -> root link's frame; None: they are in that frame.
min_range, max_range: [m] points nearer to or farther from the origin of their frame are dropped.
robot, q, self_filter_padding: points at most the padding [m] from the robot at configuration q are
  dropped.

Raises ValueError for a wrong shape or setting, ModelError for a file that cannot be read.
Immutable; threads may share it; it pickles.)";

Eigen::Isometry3d to_pose(const DoubleArray& X) {
  if (X.ndim() != 2 || X.shape(0) != 4 || X.shape(1) != 4) {
    throw py::value_error("sensor_pose is a (4, 4) matrix; an array of shape " + to_string(X) +
                          " was given");
  }
  Eigen::Isometry3d pose;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) pose(row, column) = X.at(row, column);
  }
  if (!is_rigid(pose)) throw py::value_error("sensor_pose is not a rotation and a translation");
  return pose;
}

/// Indexes an array without holding the GIL.
template <class T>
Obstacles from_array(const py::array_t<T, py::array::c_style | py::array::forcecast>& points,
                     const ObstaclesConfig& config) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const T* data = points.data();
  if (points.ndim() == 2 && points.shape(1) == 3) {
    const auto count = static_cast<std::size_t>(points.shape(0));
    const py::gil_scoped_release unlocked;
    return Obstacles(Span<const Vector>(reinterpret_cast<const Vector*>(data), count), config);
  }
  if (points.ndim() == 3 && points.shape(2) == 3) {
    const auto width = static_cast<std::size_t>(points.shape(1));
    const auto height = static_cast<std::size_t>(points.shape(0));
    const py::gil_scoped_release unlocked;
    return Obstacles::from_image(data, width, height, config);
  }
  throw py::value_error("points have the shape (n, 3) or (h, w, 3); an array of shape " +
                        to_string(points) + " was given");
}

Obstacles index(const py::object& points, const ObstaclesConfig& config) {
  const bool is_path = py::isinstance<py::str>(points) || py::hasattr(points, "__fspath__");
  if (is_path) {
    const std::string path = py::str(points);
    const py::gil_scoped_release unlocked;
    return Obstacles::from_file(path, config);
  }
  const py::array array = py::array::ensure(points);
  if (!array ||
      (array.dtype().kind() != 'f' && array.dtype().kind() != 'i' && array.dtype().kind() != 'u')) {
    PyErr_Clear();
    throw py::type_error("points are an array of numbers of shape (n, 3) or (h, w, 3), or a path");
  }
  if (array.dtype().kind() == 'f' && array.itemsize() == sizeof(float)) {
    return from_array<float>(array, config);
  }
  return from_array<double>(array, config);
}

PyObstacles make(const py::object& points, const py::object& sensor_pose, double min_range,
                 double max_range, const py::object& robot, const py::object& q,
                 double self_filter_padding) {
  ObstaclesConfig config;
  if (!sensor_pose.is_none()) config.X_FS = to_pose(py::cast<DoubleArray>(sensor_pose));
  config.min_range = min_range;
  config.max_range = max_range;
  config.self_filter_padding = self_filter_padding;
  if (!robot.is_none()) {
    config.robot = py::cast<const Robot*>(robot);
    const auto positions = py::cast<DoubleArray>(
        q.is_none() ? py::object(DoubleArray(static_cast<py::ssize_t>(0))) : q);
    check_shape(positions, 1, static_cast<py::ssize_t>(config.robot->joints().size()),
                "q has one position for each of the robot's joints");
    config.q.assign(positions.data(), positions.data() + positions.size());
  }
  py::dict arguments;
  arguments["sensor_pose"] = sensor_pose;
  arguments["min_range"] = min_range;
  arguments["max_range"] = max_range;
  arguments["robot"] = robot;
  arguments["q"] = q;
  arguments["self_filter_padding"] = self_filter_padding;
  return {index(points, config), points, arguments};
}

}  // namespace

void define_obstacles(py::module_* module) {
  const ObstaclesConfig defaults;
  py::class_<PyObstacles>(*module, "Obstacles", kDoc)
      .def(py::init(&make), py::arg("points"), py::kw_only(), py::arg("sensor_pose") = py::none(),
           py::arg("min_range") = defaults.min_range, py::arg("max_range") = kInfinity,
           py::arg("robot") = py::none(), py::arg("q") = py::none(),
           py::arg("self_filter_padding") = defaults.self_filter_padding)
      .def("__len__", [](const PyObstacles& one) { return one.obstacles.size(); })
      .def_property_readonly(
          "counts",
          [](const PyObstacles& one) {
            const IngestCounts& counts = one.obstacles.counts();
            py::dict result;
            result["received"] = counts.received;
            result["used"] = counts.used;
            result["not_a_number"] = counts.not_a_number;
            result["infinite"] = counts.infinite;
            result["out_of_range"] = counts.out_of_range;
            result["on_robot"] = counts.on_robot;
            return result;
          },
          "Numbers of points by what was done with them")
      .def_property_readonly(
          "ingest_time",
          [](const PyObstacles& one) { return one.obstacles.snapshot().ingest_time; },
          "[s] time that filtering and indexing took")
      .def("__repr__",
           [](const PyObstacles& one) {
             return "<ist_proximity.Obstacles of " + std::to_string(one.obstacles.size()) +
                    " points>";
           })
      .def(py::pickle(
          [](const PyObstacles& one) { return py::make_tuple(one.points, one.arguments); },
          [](const py::tuple& state) {
            const py::object type = py::type::of<PyObstacles>();
            const auto arguments = py::cast<py::dict>(state[1]);
            return py::cast<PyObstacles>(type(state[0], **arguments));
          }));
}

}  // namespace ist::python
