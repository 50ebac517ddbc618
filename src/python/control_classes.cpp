#include "control_classes.h"

#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include <optional>
#include <string>
#include <vector>

#include "answers.h"
#include "arrays.h"
#include "ist_proximity/control/velocity_filter.h"
#include "ist_proximity/facade/robot.h"

namespace ist::python {
namespace {

/// Rows with the robot that they are of, for texts.
struct PyRows {
  ConstraintRows rows;
  Robot robot;
};

/// The answer with its text.
struct PyFilterAnswer {
  FilterAnswer answer;
  std::string text;
};

/// The answers of one configuration.
std::vector<LinkProximity> to_answers(const Distances& distances, std::size_t links) {
  const auto state = distances.state.cast<DoubleArray>();
  const auto bound = distances.lower_bound.cast<DoubleArray>();
  const auto distance = distances.distance.cast<DoubleArray>();
  constexpr const char* kWhat =
      "distances are those of one configuration, of each of the robot's links";
  const auto count = static_cast<py::ssize_t>(links);
  for (const DoubleArray* array : {&state, &bound, &distance}) check_shape(*array, 1, count, kWhat);
  const auto on_link = distances.p_FCl.cast<DoubleArray>();
  const auto on_obstacle = distances.p_FCo.cast<DoubleArray>();
  const auto direction = distances.direction.cast<DoubleArray>();
  for (const DoubleArray* array : {&on_link, &on_obstacle, &direction}) {
    check_shape(*array, 2, 3, kWhat);
    if (array->shape(0) != count) throw py::value_error(kWhat);
  }
  std::vector<LinkProximity> answers(links);
  for (std::size_t i = 0; i < links; ++i) {
    answers[i].state = static_cast<LinkState>(static_cast<int>(state.data()[i]));
    answers[i].distance = distance.data()[i];
    answers[i].lower_bound = bound.data()[i];
    answers[i].p_FCl = Eigen::Map<const Eigen::Vector3d>(on_link.data() + 3 * i);
    answers[i].p_FCo = Eigen::Map<const Eigen::Vector3d>(on_obstacle.data() + 3 * i);
    answers[i].direction = Eigen::Map<const Eigen::Vector3d>(direction.data() + 3 * i);
  }
  return answers;
}

Span<const double> span(const DoubleArray& array) {
  return {array.data(), static_cast<std::size_t>(array.size())};
}

PyRows make_rows(const Robot& robot, const py::object& given, const Distances& distances,
                 double horizon, double margin, double stop_distance, double approach_time,
                 double retreat_speed, double escape_speed, double obstacle_speed, double age,
                 double blind_skin, double linear_error) {
  const DoubleArray q = to_numbers(given, "q is an array of numbers");
  check_shape(q, 1, static_cast<py::ssize_t>(robot.joints().size()),
              "q has the shape (joints,), joints being the number of Robot.joints");
  const RowConfig config{horizon,      margin,         stop_distance, approach_time, retreat_speed,
                         escape_speed, obstacle_speed, age,           blind_skin,    linear_error};
  const std::vector<std::string> errors = config_errors(config);
  if (!errors.empty()) throw py::value_error(errors.front());
  const std::vector<LinkProximity> answers = to_answers(distances, robot.links().size());
  return {constraint_rows(*robot.model(), robot.kinematics(), span(q), answers, config), robot};
}

using OptionalVector = std::optional<std::vector<double>>;

VelocityFilter make_filter(std::vector<double> speed, const OptionalVector& lower,
                           const OptionalVector& upper, const OptionalVector& acceleration,
                           const OptionalVector& weights, double period) {
  const std::vector<double> none;
  return VelocityFilter(
      {std::move(speed), lower.value_or(none), upper.value_or(none), acceleration.value_or(none)},
      weights.value_or(none), period);
}

PyFilterAnswer run_filter(VelocityFilter* filter, const py::object& given_command,
                          const py::object& given_q, const PyRows& rows, double time_limit) {
  const DoubleArray command = to_numbers(given_command, "the command is an array of numbers");
  const DoubleArray q = to_numbers(given_q, "q is an array of numbers");
  PyFilterAnswer result;
  result.answer = filter->run(span(command), span(q), rows.rows, time_limit);
  result.text = describe(result.answer, rows.rows, *rows.robot.model());
  return result;
}

const char* name_of(FilterStatus status) {
  switch (status) {
    case FilterStatus::kFree:
      return "free";
    case FilterStatus::kLimited:
      return "limited";
    case FilterStatus::kScaled:
      return "scaled";
    case FilterStatus::kStopped:
      return "stopped";
    case FilterStatus::kFault:
      break;
  }
  return "fault";
}

constexpr const char* kRowsDoc =
    R"(Linear bounds of joint velocities, one row for each link that joints can move.

A velocity dq (joints,) [rad/s, m/s] meets row i when G[i] @ dq <= h[i] and
sweep[i] @ abs(dq) <= sweep_limit[i]. Proven: with `sweep` met for the time `horizon`, no point of
`obstacles` comes nearer to the link than `margin` (than half of what is left, where that is less).
In contact nothing is proven; is_proven is False there.)";

constexpr const char* kMakeDoc =
    R"(The rows of one configuration.

q: (joints,) [rad, m]. distances: of Robot.distances(q, obstacles), for the same q.
horizon: [s] until another velocity takes the place of this one.
margin: [m] what is proven to be left. stop_distance: [m] nearer, no witness is approached.
approach_time: [s] in which what is left above the stop distance may be used.
retreat_speed: [m/s] asked for within the stop distance; 0: a retreat is free, and not asked for.
escape_speed: [m/s] of points nearer than the margin; a fifth of it in contact.
obstacle_speed: [m/s] at most, of the obstacles. age: [s] of their measurement.
blind_skin: [m] nearer, obstacles need not be among the distances, as in a self-filter's padding.
linear_error: [m] that `radius` leaves.

Raises ValueError for another shape, or a setting that is out of range.)";

constexpr const char* kFilterDoc =
    R"(Nearest joint velocity to a commanded one, under ConstraintRows and limits of joints.

speed: (joints,) [rad/s, m/s]. lower, upper: (joints,) [rad, m] limits of positions.
acceleration: (joints,) [rad/s^2, m/s^2] from one answer to the next, within `period` [s].
weights: (joints,) of the squared differences, 1 each by default.

Raises ValueError where limits contradict each other. One thread.)";

}  // namespace

void define_control(py::module_* module) {
  using Rows = const PyRows&;
  const auto used = [](Rows self) { return static_cast<Eigen::Index>(self.rows.count); };
  py::class_<PyRows>(*module, "ConstraintRows", kRowsDoc)
      .def_property_readonly(
          "G", [used](Rows r) { return Eigen::MatrixXd(r.rows.G.topRows(used(r))); },
          "(rows, joints) [m/rad, 1] rate of approach to the nearest point; -G is the gradient of "
          "the distance by q; 0 where there is none")
      .def_property_readonly(
          "h", [used](Rows r) { return Eigen::VectorXd(r.rows.h.head(used(r))); },
          "(rows,) [m/s]; inf where there is no nearest point")
      .def_property_readonly(
          "sweep", [used](Rows r) { return Eigen::MatrixXd(r.rows.sweep.topRows(used(r))); },
          "(rows, joints) [m/rad, 1] how far a joint carries points of the link, at most")
      .def_property_readonly(
          "sweep_limit",
          [used](Rows r) { return Eigen::VectorXd(r.rows.sweep_limit.head(used(r))); },
          "(rows,) [m/s]; 0 where the link is UNKNOWN")
      .def_property_readonly(
          "radius", [used](Rows r) { return Eigen::VectorXd(r.rows.radius.head(used(r))); },
          "(rows,) [rad, m] length of a step in q within which the linear distance of the witness "
          "is off by linear_error at most; 0 where there is none")
      .def_property_readonly(
          "link",
          [](Rows r) {
            return make_array<int>({static_cast<py::ssize_t>(r.rows.count)},
                                   [&](std::size_t i) { return r.rows.origins[i].index; });
          },
          "(rows,) index of the link in Robot.links")
      .def_property_readonly(
          "is_proven",
          [](Rows r) {
            return make_array<bool>({static_cast<py::ssize_t>(r.rows.count)},
                                    [&](std::size_t i) { return r.rows.origins[i].is_proven; });
          },
          "(rows,) False in contact")
      .def("__len__", [](Rows r) { return r.rows.count; });
  const RowConfig config;
  module->def("constraint_rows", &make_rows, kMakeDoc, py::arg("robot"), py::arg("q"),
              py::arg("distances"), py::kw_only(), py::arg("horizon") = config.horizon,
              py::arg("margin") = config.margin, py::arg("stop_distance") = config.stop_distance,
              py::arg("approach_time") = config.approach_time,
              py::arg("retreat_speed") = config.retreat_speed,
              py::arg("escape_speed") = config.escape_speed,
              py::arg("obstacle_speed") = config.obstacle_speed, py::arg("age") = config.age,
              py::arg("blind_skin") = config.blind_skin,
              py::arg("linear_error") = config.linear_error);

  py::class_<PyFilterAnswer>(*module, "FilterAnswer", "A velocity that may be commanded, and why.")
      .def_property_readonly(
          "velocity",
          [](const PyFilterAnswer& a) { return py::array(py::cast(a.answer.velocity)); },
          "(joints,) [rad/s, m/s]; finite, whatever was given")
      .def_property_readonly(
          "status", [](const PyFilterAnswer& a) { return name_of(a.answer.status); },
          "'free': the command itself; 'limited': the nearest velocity; 'scaled': the command, "
          "slowed down; 'stopped': 0; 'fault': 0, because an input cannot be used")
      .def_property_readonly(
          "scale", [](const PyFilterAnswer& a) { return a.answer.scale; },
          "0 to 1: the largest share of the command that meets all bounds")
      .def_property_readonly(
          "rows", [](const PyFilterAnswer& a) { return a.answer.rows; }, "rows that hold it back")
      .def("__str__", [](const PyFilterAnswer& a) { return a.text; });

  const py::none none;
  py::class_<VelocityFilter>(*module, "VelocityFilter", kFilterDoc)
      .def(py::init(&make_filter), py::arg("speed"), py::kw_only(), py::arg("lower") = none,
           py::arg("upper") = none, py::arg("acceleration") = none, py::arg("weights") = none,
           py::arg("period") = 0.01)
      .def("run", &run_filter, py::arg("command"), py::arg("q"), py::arg("rows"), py::kw_only(),
           py::arg("time_limit") = 0.0,
           "The FilterAnswer to a command (joints,) [rad/s, m/s] at q (joints,) [rad, m]; its str "
           "names what holds it back. It never raises for wrong values, but gives 0. time_limit: "
           "[s] after which the command is slowed down instead; 0: none.")
      .def("reset", &VelocityFilter::reset, "Forgets the last velocity: the robot stands.");
}

}  // namespace ist::python
