#include "robot_class.h"

#include <pybind11/functional.h>
#include <pybind11/stl.h>

#include <atomic>
#include <chrono>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "answers.h"
#include "arrays.h"
#include "ist_proximity/facade/robot.h"
#include "obstacles_class.h"
#include "robot_measures.h"

namespace ist::python {
namespace {

constexpr const char* kRobotDoc =
    R"(A robot that tells its distances to obstacles.

urdf: the path of a URDF file, or its text. package://NAME/ is looked for in package_dirs and
  ROS_PACKAGE_PATH; relative paths of meshes start from the file's folder.
geometry: "collision" (falls back to visual) or "visual".
max_error: [m] largest gap between a link's surface and its inner spheres; it changes the time of a
  query, not its answer.
max_spheres: most spheres of a link.
links: names of the links to monitor; none: every link that has geometry.
cache_directory: where packings are kept; empty: nowhere.
package_dirs: a folder or several that are packages, or hold them, by the names of their folders.
allow_unknown_links: whether links that cannot be used are UNKNOWN (unknown_links says why); else
  they raise ModelError. Answers for the whole robot have a lower bound of -inf then.
progress: called with the share that is packed, from 0 to 1. An exception in it ends the packing.
warning: called with each sentence for the user.

A configuration q has one position [rad, m] for each of `joints`, nan where it is not known. All
points and poses are in the root link's frame. Immutable; threads may share it; queries do not hold
the GIL; it pickles with its shapes and spheres, so that a worker on another machine needs no file.
Two answers to one question, or those of a robot and of its pickle, may differ within `tolerance`:
what was asked before decides where a query stops. Each bound is proven; with tolerance=0 the
distances are the true ones.

Raises ModelError when the robot cannot be read or packed.)";

constexpr const char* kQueryDoc =
    R"(obstacles: Obstacles.
max_distance: [m] a link without an obstacle nearer than this is CLEAR; more than 1e9, also inf, counts as 1e9.
tolerance: [m] largest distance - lower_bound; 0: exact.
margin: [m] subtracted from every lower bound.
relative_tolerance: tolerance as a share of the distance, where that is wider.
deadline: [s] of one configuration; 0: none.
threads: for many configurations; 0: all cores.)";

/// The text of a docstring that ends with the arguments of a query.
std::string with_query(const char* text) { return std::string(text) + "\n\n" + kQueryDoc; }

using DoneCallback = std::function<void(double)>;
using TextCallback = std::function<void(const std::string&)>;

/// Reads and packs on a thread of its own. This thread calls Python: progress, and Ctrl-C.
Robot make_robot(const py::object& urdf, const std::string& geometry, double max_error,
                 int max_spheres, const std::vector<std::string>& links,
                 const py::object& cache_directory, const py::object& package_dirs,
                 bool allow_unknown_links, const DoneCallback& progress,
                 const TextCallback& warning) {
  RobotConfig config;
  if (geometry != "collision" && geometry != "visual") {
    throw py::value_error("geometry is 'collision' or 'visual', not '" + geometry + "'");
  }
  config.geometry = geometry == "visual" ? GeometrySource::kVisual : GeometrySource::kCollision;
  config.packing.max_error = max_error;
  config.packing.max_spheres = max_spheres;
  config.links = links;
  config.cache_directory = to_path(cache_directory);
  const py::object folders = is_path(package_dirs) ? py::make_tuple(package_dirs) : package_dirs;
  for (const py::handle& folder : folders) {
    config.package_dirs.push_back(to_path(py::reinterpret_borrow<py::object>(folder)));
  }
  config.allow_unknown_links = allow_unknown_links;
  const std::string path_or_text = to_path(urdf);

  std::atomic<double> fraction{0.0};
  std::atomic<bool> cancelled{false};
  std::vector<std::string> warnings;  // read when the thread has ended
  config.callbacks.progress = [&](const ModelProgress& now) { fraction = now.fraction; };
  config.callbacks.cancelled = [&] { return cancelled.load(); };
  config.callbacks.warning = [&](const std::string& text) { warnings.push_back(text); };
  auto result = std::async(std::launch::async, [&] { return Robot(path_or_text, config); });
  const auto is_done = [&] {
    const py::gil_scoped_release unlocked;
    return result.wait_for(std::chrono::milliseconds(50)) == std::future_status::ready;
  };
  const auto cancel = [&] {
    cancelled = true;
    const py::gil_scoped_release unlocked;
    result.wait();
  };
  double told = -1.0;
  while (!is_done()) {
    try {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      const double now = fraction;
      if (progress && now > told) progress(now);
      told = now;
    } catch (...) {
      cancel();
      throw;
    }
  }
  Robot robot = result.get();
  if (progress) progress(1.0);
  if (warning) {
    for (const std::string& text : warnings) warning(text);
  }
  return robot;
}

/// Configurations as rows; a dictionary names joints, the others are at 0, or follow.
struct Configurations {
  Configurations(const Robot& robot, const py::object& q) {
    if (py::isinstance<py::dict>(q)) {
      const std::vector<double> one =
          robot.configuration(to_positions(py::reinterpret_borrow<py::dict>(q)));
      array = DoubleArray(static_cast<py::ssize_t>(one.size()), one.data());
      return;
    }
    array = to_numbers(q, "q is an array of numbers, or a dictionary by joint names");
    const auto joints = static_cast<py::ssize_t>(robot.joints().size());
    if (array.ndim() != 1 && array.ndim() != 2) check_shape(array, 2, joints, kWhat);
    check_shape(array, array.ndim(), joints, kWhat);
    if (array.ndim() == 2) shape.push_back(array.shape(0));
  }

  Span<const double> values() const {
    return {array.data(), static_cast<std::size_t>(array.size())};
  }

  /// A robot without joints has one configuration, which is answered once; every row has it.
  template <class Answer>
  void repeat(std::vector<Answer>* answers) const {
    if (array.ndim() != 2 || array.shape(1) > 0) return;
    const std::vector<Answer> one = std::move(*answers);
    answers->clear();
    for (py::ssize_t k = 0; k < array.shape(0); ++k) {
      answers->insert(answers->end(), one.begin(), one.end());
    }
  }

  static constexpr const char* kWhat =
      "q has the shape (joints,) or (n, joints), joints being the number of Robot.joints";
  DoubleArray array;
  Shape shape;  ///< of one answer for each configuration
};

BatchConfig batch_config(double max_distance, double tolerance, double margin,
                         double relative_tolerance, double deadline, int threads) {
  BatchConfig config;
  config.query.max_distance = max_distance;
  config.query.tolerance = tolerance;
  config.query.margin = margin;
  config.query.relative_tolerance = relative_tolerance;
  config.query.deadline = deadline;
  config.threads = threads;
  return config;
}

Distances distances(const Robot& robot, const py::object& q, const PyObstacles& obstacles,
                    double max_distance, double tolerance, double margin, double relative_tolerance,
                    double deadline, int threads) {
  const Configurations configurations(robot, q);
  BatchConfig config =
      batch_config(max_distance, tolerance, margin, relative_tolerance, deadline, threads);
  Shape shape = configurations.shape;
  std::vector<LinkProximity> answers;
  {
    const Span<const double> values = configurations.values();
    const Obstacles& points = obstacles.obstacles;
    const py::gil_scoped_release unlocked;
    answers = shape.empty() ? robot.distances(values, points, config.query)
                            : robot.distances_batch(values, points, config);
  }
  configurations.repeat(&answers);
  shape.push_back(static_cast<py::ssize_t>(robot.links().size()));
  return to_arrays(answers, shape);
}

Nearest nearest(const Robot& robot, const py::object& q, const PyObstacles& obstacles,
                double max_distance, double tolerance, double margin, double relative_tolerance,
                double deadline, int threads) {
  const Configurations configurations(robot, q);
  const BatchConfig config =
      batch_config(max_distance, tolerance, margin, relative_tolerance, deadline, threads);
  std::vector<RobotProximity> answers;
  {
    const Span<const double> values = configurations.values();
    const Obstacles& points = obstacles.obstacles;
    const py::gil_scoped_release unlocked;
    if (configurations.shape.empty()) {
      answers = {robot.nearest(values, points, config.query)};
    } else {
      answers = robot.nearest_batch(values, points, config);
    }
  }
  configurations.repeat(&answers);
  return to_arrays(answers, configurations.shape);
}

Distances distances_at(const Robot& robot, const py::object& given, const PyObstacles& obstacles,
                       double max_distance, double tolerance, double margin,
                       double relative_tolerance, double deadline, int threads) {
  const DoubleArray poses = to_numbers(given, "poses are an array of numbers");
  const auto links = static_cast<py::ssize_t>(robot.links().size());
  const py::ssize_t n = poses.ndim();
  const bool fits = (n == 3 || n == 4) && poses.shape(n - 3) == links && poses.shape(n - 2) == 4 &&
                    poses.shape(n - 1) == 4;
  if (!fits) {
    throw py::value_error(
        "poses have the shape (links, 4, 4) or (n, links, 4, 4), links being the number of "
        "Robot.links; an array of shape " +
        to_string(poses) + " was given");
  }
  std::vector<Eigen::Isometry3d> X_FL(static_cast<std::size_t>(poses.size() / 16));
  for (std::size_t i = 0; i < X_FL.size(); ++i) {
    X_FL[i].matrix() =
        Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(poses.data() + 16 * i);
    check_last_row(X_FL[i].matrix(), "a pose");
  }
  const BatchConfig config =
      batch_config(max_distance, tolerance, margin, relative_tolerance, deadline, threads);
  std::vector<LinkProximity> answers;
  {
    const Obstacles& points = obstacles.obstacles;
    const py::gil_scoped_release unlocked;
    answers = robot.distances_at(X_FL, points, config);
  }
  Shape shape;
  if (n == 4) shape.push_back(poses.shape(0));
  shape.push_back(links);
  return to_arrays(answers, shape);
}

/// Rows of trajectory k out of an array (n, joints) or (m, n, joints); none for an array that is
/// left out.
std::vector<std::vector<double>> rows_of(const DoubleArray& array, std::size_t k, std::size_t n,
                                         std::size_t joints) {
  std::vector<std::vector<double>> rows;
  if (array.ndim() == 1) return rows;
  const double* first = array.data() + k * n * joints;
  for (std::size_t i = 0; i < n; ++i)
    rows.emplace_back(first + i * joints, first + (i + 1) * joints);
  return rows;
}

/// Raises ValueError where an array is neither left out nor like the positions.
void check_like(const DoubleArray& positions, const DoubleArray& array, const char* name) {
  const bool is_left_out = array.ndim() == 1 && array.size() == 0;
  if (is_left_out || to_string(array) == to_string(positions)) return;
  throw py::value_error(std::string(name) + " have the shape of the positions, " +
                        to_string(positions) + "; an array of shape " + to_string(array) +
                        " was given");
}

py::dict clearance(const Robot& robot, const py::object& given_times,
                   const py::object& given_positions, const PyObstacles& obstacles,
                   const py::object& given_velocities, const py::object& given_accelerations,
                   double max_distance, double margin, int threads) {
  const DoubleArray times = to_numbers(given_times, "times are an array of numbers");
  const DoubleArray positions = to_numbers(given_positions, "positions are an array of numbers");
  const DoubleArray velocities = to_numbers(given_velocities, "velocities are an array of numbers");
  const DoubleArray accelerations =
      to_numbers(given_accelerations, "accelerations are an array of numbers");
  const bool is_many = positions.ndim() == 3;
  const auto joints = static_cast<py::ssize_t>(robot.joints().size());
  check_shape(positions, is_many ? 3 : 2, joints,
              "positions have the shape (n, joints) or (m, n, joints)");
  check_like(positions, velocities, "velocities");
  check_like(positions, accelerations, "accelerations");
  const py::ssize_t n = positions.shape(is_many ? 1 : 0), m = is_many ? positions.shape(0) : 1;
  const bool fits = times.ndim() == 1
                        ? times.shape(0) == n
                        : times.ndim() == 2 && times.shape(0) == m && times.shape(1) == n;
  if (!fits) {
    throw py::value_error("times have the shape (n,) or (m, n); an array of shape " +
                          to_string(times) + " was given");
  }
  std::vector<JointTrajectory> trajectories;
  for (std::size_t k = 0; k < static_cast<std::size_t>(m); ++k) {
    const auto rows = static_cast<std::size_t>(n), columns = static_cast<std::size_t>(joints);
    const double* first = times.data() + (times.ndim() == 2 ? k * rows : 0);
    trajectories.push_back({{first, first + rows},
                            rows_of(positions, k, rows, columns),
                            rows_of(velocities, k, rows, columns),
                            rows_of(accelerations, k, rows, columns)});
  }
  const BatchConfig config = batch_config(max_distance, 0.0, margin, 0.0, 0.0, threads);
  std::vector<LinkClearance> answers;
  {
    const Obstacles& points = obstacles.obstacles;
    const py::gil_scoped_release unlocked;
    answers = robot.clearance(trajectories, points, config);
  }
  Shape shape;
  if (is_many) shape.push_back(m);
  shape.push_back(static_cast<py::ssize_t>(robot.links().size()));
  const auto array = [&](double LinkClearance::*number) {
    return make_array<double>(shape, [&](std::size_t i) { return answers[i].*number; });
  };
  py::dict result;
  result["contact_time"] = array(&LinkClearance::contact_time);
  result["lower_bound"] = array(&LinkClearance::lower_bound);
  result["nearest_time"] = array(&LinkClearance::nearest_time);
  shape.push_back(joints);
  const auto columns = static_cast<std::size_t>(joints);
  result["gradient"] = make_array<double>(shape, [&](std::size_t i) {
    const std::vector<double>& one = answers[i / columns].gradient;
    return one.empty() ? std::numeric_limits<double>::quiet_NaN() : one[i % columns];
  });
  return result;
}

py::object link_poses(const Robot& robot, const py::object& q) {
  const Configurations configurations(robot, q);
  const Span<const double> values = configurations.values();
  const std::size_t links = robot.links().size();
  const std::size_t n =
      configurations.shape.empty() ? 1 : static_cast<std::size_t>(configurations.shape[0]);
  const std::size_t columns = n > 0 ? values.size() / n : 0;
  std::vector<LinkPoses> poses;
  for (std::size_t k = 0; k < n; ++k) {
    poses.push_back(robot.link_poses({values.data() + k * columns, columns}));
  }
  Shape shape = configurations.shape;
  for (const std::size_t size : {links, std::size_t{4}, std::size_t{4}}) {
    shape.push_back(static_cast<py::ssize_t>(size));
  }
  return make_array<double>(shape, [&](std::size_t k) {
    const LinkPoses& one = poses[k / (16 * links)];
    const std::size_t link = k / 16 % links;
    if (!one.known[link]) return std::numeric_limits<double>::quiet_NaN();
    const auto at = static_cast<Eigen::Index>(k % 16);
    return one.X_FL[link].matrix()(at / 4, at % 4);
  });
}

template <class... Arguments>
void define_query(py::class_<Robot>* type, const char* name, Arguments&&... rest) {
  const QueryConfig defaults;
  type->def(name, std::forward<Arguments>(rest)..., py::arg("obstacles"), py::kw_only(),
            py::arg("max_distance") = defaults.max_distance,
            py::arg("tolerance") = defaults.tolerance, py::arg("margin") = defaults.margin,
            py::arg("relative_tolerance") = defaults.relative_tolerance,
            py::arg("deadline") = defaults.deadline, py::arg("threads") = 0);
}

}  // namespace

void define_robot(py::module_* module) {
  const PackingConfig defaults;
  py::class_<Robot> type(*module, "Robot", kRobotDoc);
  type.def(py::init(&make_robot), py::arg("urdf"), py::kw_only(), py::arg("geometry") = "collision",
           py::arg("max_error") = defaults.max_error, py::arg("max_spheres") = defaults.max_spheres,
           py::arg("links") = std::vector<std::string>(), py::arg("cache_directory") = "",
           py::arg("package_dirs") = py::list(), py::arg("allow_unknown_links") = false,
           py::arg("progress") = py::none(), py::arg("warning") = py::none())
      .def_property_readonly("name", &Robot::name, "name of the robot in the URDF")
      .def_property_readonly(
          "root_link", [](const Robot& robot) { return robot.description().root_link; },
          "name of the root link, whose frame all points and poses are in")
      .def_property_readonly("links", &Robot::links, "names of the links, in the order of answers")
      .def_property_readonly("joints", &Robot::joints, "names of the joints, in the order of q")
      .def_property_readonly(
          "lower_limits",
          [](const Robot& robot) { return py::array(py::cast(robot.lower_limits())); },
          "(joints,) [rad, m], may be -inf")
      .def_property_readonly(
          "upper_limits",
          [](const Robot& robot) { return py::array(py::cast(robot.upper_limits())); },
          "(joints,) [rad, m], may be inf")
      .def(
          "link_poses", &link_poses, py::arg("q"),
          "Forward kinematics: (links, 4, 4) or (n, links, 4, 4), link frame -> root link's frame; "
          "nan where it is not known.")
      .def_property_readonly(
          "links_without_geometry",
          [](const Robot& robot) { return robot.description().links_without_geometry; },
          "names of the other links of the URDF")
      .def_property_readonly(
          "unknown_links",
          [](const Robot& robot) {
            py::dict reasons;
            for (const LinkModel& link : robot.model()->links) {
              if (!link.usable()) reasons[py::str(link.name)] = link.error;
            }
            return reasons;
          },
          "why links cannot be used, by their names")
      .def("__repr__",
           [](const Robot& robot) {
             return "<ist_proximity.Robot '" + robot.name() +
                    "': " + std::to_string(robot.links().size()) + " links, " +
                    std::to_string(robot.joints().size()) + " joints>";
           })
      .def(
          py::pickle([](const Robot& robot) { return py::make_tuple(py::bytes(robot.to_bytes())); },
                     [](const py::tuple& state) {
                       const auto bytes = py::cast<std::string>(py::cast<py::bytes>(state[0]));
                       const py::gil_scoped_release unlocked;
                       return Robot::from_bytes(bytes);
                     }));
  define_query(
      &type, "distances", &distances,
      with_query("Distances of all links.\n\nq: (joints,) or (n, joints) [rad, m], or a "
                 "dictionary by joint names; joints that it leaves out are at 0, and mimic "
                 "joints follow.")
          .c_str(),
      py::arg("q"));
  define_query(
      &type, "nearest", &nearest,
      with_query(
          "The nearest link only; the others are asked as far as that needs.\n\nq: (joints,) or "
          "(n, joints) [rad, m], or a dictionary by joint names.")
          .c_str(),
      py::arg("q"));
  define_query(&type, "distances_at", &distances_at,
               with_query("Distances at poses from any kinematics.\n\nposes: (links, 4, 4) or "
                          "(n, links, 4, 4), link frame -> root link's frame; a link whose pose is "
                          "nan is UNKNOWN.")
                   .c_str(),
               py::arg("poses"));
  const QueryConfig query;
  const DoubleArray none(0);
  type.def("clearance", &clearance, py::arg("times"), py::arg("positions"), py::arg("obstacles"),
           py::kw_only(), py::arg("velocities") = none, py::arg("accelerations") = none,
           py::arg("max_distance") = query.max_distance, py::arg("margin") = query.margin,
           py::arg("threads") = 0,
           R"(First contacts and clearances along trajectories, among obstacles that stand still.

times: (n,) or (m, n) [s], rising. positions: (n, joints) or (m, n, joints) [rad, m]; mimic joints follow.
velocities, accelerations: like positions, or none. Joints move straight between positions, along cubic polynomials
with velocities, along quintic ones with accelerations too.
Returns a dictionary of arrays (links,) or (m, links): contact_time [s], never later than the first contact, inf without
one, nan where it is not known; lower_bound [m] of the distance until the end or that time, at most the least distance and
less by a quarter of it or 2 mm (more along a polynomial with a second derivative above 16 rad, with the time between
two positions as its unit); nearest_time [s] of the least bound found; and gradient (links, joints) or (m, links,
joints) of the distance then, [m/rad, 1] by Robot.joints, nan in contact or with nothing near.)");
  define_measures(&type);
}

}  // namespace ist::python
