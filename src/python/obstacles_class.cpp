#include "obstacles_class.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "arrays.h"
#include "extent_class.h"
#include "internal/facade/sensor_points.h"
#include "ist_proximity/facade/robot.h"

namespace ist::python {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

constexpr const char* kDoc =
    R"(Points of obstacles, indexed for queries. Points that are not finite are dropped. An empty
array says that there are no obstacles.

points: (n, 3) [m], a list; or (h, w, 3), an image with nan where nothing was measured, which is
  indexed several times faster; or the path of a PCD or PLY file. float32 stays float32.
sensor_pose: (4, 4), frame of the points -> root link's frame; None: they are in that frame. Of a PCD
  file with a VIEWPOINT: the frame that this is stated in.
min_range, max_range: [m] points nearer to or farther from the origin of their frame (of a PCD file:
  from its VIEWPOINT) are dropped.
robot, q, self_filter_padding: points at most the padding [m] from the robot at configuration q are
  dropped.
extent: how large points are, so that lower bounds hold for the surface in place of its samples: an
  Extent, or a number: their radius [m]. None: points are points.

Raises ValueError for a wrong shape or setting, and where no point was measured: all are nan, infinite,
nearer than min_range, or at one place (a driver without returns); ModelError for a file that cannot be read.
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

/// Views a C-contiguous array.
template <class T>
PointArray view(const py::array& given) {
  auto points = py::array_t<T, py::array::c_style | py::array::forcecast>::ensure(given);
  if (!points) throw py::error_already_set();
  const bool is_list = points.ndim() == 2 && points.shape(1) == 3;
  if (!is_list && !(points.ndim() == 3 && points.shape(2) == 3)) {
    throw py::value_error("points have the shape (n, 3) or (h, w, 3); an array of shape " +
                          to_string(points) + " was given");
  }
  const auto height = is_list ? 1 : static_cast<std::size_t>(points.shape(0));
  const auto width = static_cast<std::size_t>(points.shape(is_list ? 0 : 1));
  PointArray result;
  result.cloud = packed_cloud(points.data(), width, height);
  result.array = std::move(points);
  return result;
}

PointArray read(const py::object& points) {
  if (is_path(points)) {
    const std::string path = to_path(points);
    PointArray result;
    const py::gil_scoped_release unlocked;
    result.file = read_sensor_points(path);
    const double* data = result.file.points.empty() ? nullptr : result.file.points.data()->data();
    result.cloud = packed_cloud(data, result.file.width, result.file.height);
    return result;
  }
  const py::array array = py::array::ensure(points);
  if (!array ||
      (array.dtype().kind() != 'f' && array.dtype().kind() != 'i' && array.dtype().kind() != 'u')) {
    PyErr_Clear();
    throw py::type_error("points are an array of numbers of shape (n, 3) or (h, w, 3), or a path");
  }
  if (array.dtype().kind() == 'f' && array.itemsize() == sizeof(float)) return view<float>(array);
  return view<double>(array);
}

template <class T>
Obstacles index_as(const RawCloud& cloud, const ObstaclesConfig& config) {
  using Vector = Eigen::Matrix<T, 3, 1>;
  const auto* data = reinterpret_cast<const T*>(cloud.data);
  if (cloud.height != 1) return Obstacles::from_image(data, cloud.width, cloud.height, config);
  return Obstacles(Span<const Vector>(reinterpret_cast<const Vector*>(data), cloud.width), config);
}

/// Indexes points without holding the GIL.
Obstacles index(const PointArray& points, const ObstaclesConfig& config) {
  const py::gil_scoped_release unlocked;
  return points.cloud.is_double ? index_as<double>(points.cloud, config)
                                : index_as<float>(points.cloud, config);
}

ObstaclesConfig config_of(const py::dict& arguments) {
  ObstaclesConfig config;
  const py::object sensor_pose = arguments["sensor_pose"], robot = arguments["robot"],
                   q = arguments["q"], extent = arguments["extent"];
  if (!sensor_pose.is_none()) config.X_FS = to_pose(py::cast<DoubleArray>(sensor_pose));
  config.min_range = py::cast<double>(arguments["min_range"]);
  config.max_range = py::cast<double>(arguments["max_range"]);
  config.self_filter_padding = py::cast<double>(arguments["self_filter_padding"]);
  if (!extent.is_none()) config.extent = to_extent(extent);
  if (!robot.is_none()) {
    config.robot = py::cast<const Robot*>(robot);
    const auto positions = py::cast<DoubleArray>(
        q.is_none() ? py::object(DoubleArray(static_cast<py::ssize_t>(0))) : q);
    check_shape(positions, 1, static_cast<py::ssize_t>(config.robot->joints().size()),
                "q has one position for each of the robot's joints");
    config.q.assign(positions.data(), positions.data() + positions.size());
  }
  return config;
}

/// A copy that nobody else changes.
py::object owned(const PointArray& points) {
  if (points.array) return points.array.attr("copy")();
  const std::vector<Eigen::Vector3d>& list = points.file.points;
  const auto width = static_cast<py::ssize_t>(points.file.width),
             height = static_cast<py::ssize_t>(points.file.height);
  DoubleArray copy(height == 1 ? Shape{width, 3} : Shape{height, width, 3});
  if (!list.empty()) std::copy_n(list.data()->data(), copy.size(), copy.mutable_data());
  return std::move(copy);
}
py::object owned(const py::object& array) {
  return array.is_none() ? array : py::module_::import("numpy").attr("array")(array);
}

PyObstacles make(const py::object& points, const py::object& sensor_pose, double min_range,
                 double max_range, const py::object& robot, const py::object& q,
                 double self_filter_padding, const py::object& extent) {
  py::dict arguments;
  arguments["sensor_pose"] = owned(sensor_pose);
  arguments["min_range"] = min_range;
  arguments["max_range"] = max_range;
  arguments["robot"] = robot;
  arguments["q"] = owned(q);
  arguments["self_filter_padding"] = self_filter_padding;
  arguments["extent"] = extent;
  const PointArray array = read(points);
  if (!array.file.X_QS.matrix().isIdentity(0.0)) {  // the file says where its sensor was
    const Eigen::Matrix4d X_FS = (config_of(arguments).X_FS * array.file.X_QS).matrix();
    arguments["sensor_pose"] = make_array<double>({4, 4}, [&](std::size_t k) {
      return X_FS(static_cast<Eigen::Index>(k / 4), static_cast<Eigen::Index>(k % 4));
    });
  }
  return {index(array, config_of(arguments)), owned(array), arguments};
}

}  // namespace

PointArray read_again(const PyObstacles& obstacles) { return read(obstacles.points); }

ObstaclesConfig config_of(const PyObstacles& obstacles) { return config_of(obstacles.arguments); }

void define_obstacles(py::module_* module) {
  const ObstaclesConfig defaults;
  py::class_<PyObstacles>(*module, "Obstacles", kDoc)
      .def(py::init(&make), py::arg("points"), py::kw_only(), py::arg("sensor_pose") = py::none(),
           py::arg("min_range") = defaults.min_range, py::arg("max_range") = kInfinity,
           py::arg("robot") = py::none(), py::arg("q") = py::none(),
           py::arg("self_filter_padding") = defaults.self_filter_padding,
           py::arg("extent") = py::none())
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
            result["measured"] = counts.measured();
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
