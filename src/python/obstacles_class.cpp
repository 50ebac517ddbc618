#include "obstacles_class.h"

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "arrays.h"
#include "extent_class.h"
#include "internal/facade/sensor_points.h"
#include "internal/geometry/numbers.h"
#include "ist_proximity/facade/robot.h"

namespace ist::python {
namespace {

constexpr const char* kDoc =
    R"(Points of obstacles, indexed for queries. Points that are not finite are dropped. An empty
array says that there are no obstacles.

points: (n, 3) [m], a list; or (h, w, 3), an image with nan where nothing was measured, which is
  indexed several times faster; whatever numpy takes for such an array (lists, open3d's .points); a
  sensor_msgs/PointCloud2 (of rospy or of a bag); or the path of a PCD or PLY file. float32 stays float32.
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
  check_last_row(pose.matrix(), "sensor_pose");
  if (!is_rigid(pose)) throw py::value_error("sensor_pose is not a rotation and a translation");
  return pose;
}

/// Views an array of float32 or float64 that nobody changes. Its last reader may be any thread.
template <class T>
PointArray view_as(const py::array_t<T>& points) {
  const bool is_list = points.ndim() == 2;
  PointArray result;
  result.cloud =
      packed_cloud(points.data(), static_cast<std::size_t>(points.shape(is_list ? 0 : 1)),
                   is_list ? 1 : static_cast<std::size_t>(points.shape(0)));
  PyObject* const kept = points.inc_ref().ptr();
  result.cloud.owner = std::shared_ptr<const void>(kept, [kept](const void*) {
    const py::gil_scoped_acquire locked;
    Py_DECREF(kept);
  });
  result.array = points;
  return result;
}

PointArray view(const py::object& points) {
  if (py::isinstance<py::array_t<float>>(points)) return view_as<float>(points);
  return view_as<double>(points);
}

/// An array of its own: x, y and z of a sensor_msgs/PointCloud2.
py::array array_of_message(const py::object& message) {
  CloudLayout layout;
  for (const py::handle& field : message.attr("fields")) {
    layout.fields.push_back({py::cast<std::string>(field.attr("name")),
                             py::cast<std::uint32_t>(field.attr("offset")),
                             py::cast<std::uint8_t>(field.attr("datatype")),
                             py::cast<std::uint32_t>(field.attr("count"))});
  }
  layout.width = py::cast<std::uint32_t>(message.attr("width"));
  layout.height = py::cast<std::uint32_t>(message.attr("height"));
  layout.point_step = py::cast<std::uint32_t>(message.attr("point_step"));
  layout.row_step = py::cast<std::uint32_t>(message.attr("row_step"));
  layout.is_bigendian = py::cast<bool>(py::bool_(message.attr("is_bigendian")));
  const py::object bytes = message.attr("data");
  const py::buffer_info data = py::buffer(bytes).request();
  layout.data = static_cast<const std::uint8_t*>(data.ptr);
  layout.data_size = static_cast<std::size_t>(data.size * data.itemsize);
  RawCloud cloud;
  const std::string fault = check_layout(layout, &cloud);
  if (!fault.empty()) throw py::value_error("malformed cloud: " + fault);
  const py::module_ numpy = py::module_::import("numpy");
  if (cloud.size() == 0) return numpy.attr("zeros")(py::make_tuple(0, 3));
  const std::string type =
      std::string(layout.is_bigendian ? ">" : "<") + (cloud.is_double ? "f8" : "f4");
  py::list coordinates;
  for (const std::size_t offset : {cloud.x, cloud.y, cloud.z}) {
    coordinates.append(numpy.attr("ndarray")(py::make_tuple(cloud.height, cloud.width), type, bytes,
                                             offset,
                                             py::make_tuple(cloud.row_step, cloud.point_step)));
  }
  const py::array image = numpy.attr("stack")(coordinates, 2);
  return cloud.height == 1 ? py::array(image[py::int_(0)]) : image;
}

/// An array of its own: the points of a file.
/// @param X_QS  receives the pose of their sensor
py::array array_of_file(const std::string& path, Eigen::Isometry3d* X_QS) {
  RawCloud cloud;
  {
    const py::gil_scoped_release unlocked;
    PointFile file = read_sensor_points(path);
    *X_QS = file.X_QS;
    cloud = to_cloud(std::move(file));
  }
  const auto width = static_cast<py::ssize_t>(cloud.width),
             height = static_cast<py::ssize_t>(cloud.height);
  const Shape shape = height == 1 ? Shape{width, 3} : Shape{height, width, 3};
  const py::dtype type = cloud.is_double ? py::dtype::of<double>() : py::dtype::of<float>();
  return py::array(type, shape, cloud.data);
}

/// An array of float32 or float64 of its own, of whatever Obstacles takes.
py::array to_array(const py::object& points, Eigen::Isometry3d* X_QS) {
  if (is_path(points)) return array_of_file(to_path(points), X_QS);
  const bool is_message = py::hasattr(points, "fields") && py::hasattr(points, "point_step");
  const py::array given =
      is_message ? array_of_message(points) : py::array::ensure(without_mask(points));
  const char kind = given ? given.dtype().kind() : '?';
  if (kind != 'f' && kind != 'i' && kind != 'u') {
    PyErr_Clear();
    throw py::type_error(
        "points are an array of numbers of shape (n, 3) or (h, w, 3), a sensor_msgs/PointCloud2, "
        "or a path");
  }
  const py::ssize_t dimensions = given.ndim();
  if (dimensions == 1 && given.size() == 0) return DoubleArray(Shape{0, 3});  // an empty list
  if (dimensions < 2 || dimensions > 3 || given.shape(dimensions - 1) != 3) {
    throw py::value_error("points have the shape (n, 3) or (h, w, 3); an array of shape " +
                          to_string(given) + " was given");
  }
  const bool is_float = kind == 'f' && given.itemsize() == sizeof(float);
  return py::module_::import("numpy").attr("array")(
      given, is_float ? py::dtype::of<float>() : py::dtype::of<double>(), py::arg("order") = "C",
      py::arg("subok") = false);
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
  if (robot.is_none()) return config;
  if (!py::isinstance<Robot>(robot)) throw py::type_error("robot is a Robot");
  config.robot = py::cast<const Robot*>(robot);
  if (py::isinstance<py::dict>(q)) {
    config.q = config.robot->configuration(to_positions(py::reinterpret_borrow<py::dict>(q)));
    return config;
  }
  const auto positions =
      py::cast<DoubleArray>(q.is_none() ? py::object(DoubleArray(static_cast<py::ssize_t>(0))) : q);
  check_shape(positions, 1, static_cast<py::ssize_t>(config.robot->joints().size()),
              "q has one position for each of the robot's joints");
  config.q.assign(positions.data(), positions.data() + positions.size());
  return config;
}

/// A copy that nobody else changes, of None, a dictionary or an array.
py::object owned(const py::object& given, const char* what) {
  if (given.is_none()) return given;
  if (py::isinstance<py::dict>(given)) return given.attr("copy")();
  return py::module_::import("numpy").attr("array")(to_numbers(given, what));
}

PyObstacles make(const py::object& points, const py::object& sensor_pose, double min_range,
                 double max_range, const py::object& robot, const py::object& q,
                 double self_filter_padding, const py::object& extent) {
  py::dict arguments;
  arguments["sensor_pose"] = owned(sensor_pose, "sensor_pose is a (4, 4) matrix");
  arguments["min_range"] = min_range;
  arguments["max_range"] = max_range;
  arguments["robot"] = robot;
  arguments["q"] = owned(q, "q is an array of numbers, or a dictionary by joint names");
  arguments["self_filter_padding"] = self_filter_padding;
  arguments["extent"] = extent;
  Eigen::Isometry3d X_QS = Eigen::Isometry3d::Identity();
  const PointArray array = view(to_array(points, &X_QS));
  if (!X_QS.matrix().isIdentity(0.0)) {  // the file says where its sensor was
    const Eigen::Matrix4d X_FS = (config_of(arguments).X_FS * X_QS).matrix();
    arguments["sensor_pose"] = make_array<double>({4, 4}, [&](std::size_t k) {
      return X_FS(static_cast<Eigen::Index>(k / 4), static_cast<Eigen::Index>(k % 4));
    });
  }
  array.array.attr("setflags")(py::arg("write") = false);
  const ObstaclesConfig config = config_of(arguments);
  const Obstacles obstacles = [&] {
    const py::gil_scoped_release unlocked;
    return Obstacles::from_cloud(array.cloud, config);
  }();
  return {obstacles, array.array, arguments};
}

}  // namespace

PointArray read_again(const PyObstacles& obstacles) { return view(obstacles.points); }

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
