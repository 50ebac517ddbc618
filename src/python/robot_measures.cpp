#include "robot_measures.h"

#include <pybind11/stl.h>

#include <variant>
#include <vector>

#include "arrays.h"
#include "internal/geometry/boundary_edges.h"
#include "internal/packing/packing_report.h"
#include "ist_proximity/facade/cost.h"
#include "obstacles_class.h"

namespace ist::python {
namespace {

/// One dictionary for each link.
py::list packing(const Robot& robot) {
  py::list links;
  for (const LinkModel& link : robot.model()->links) {
    const std::vector<InnerSphere>& spheres = link.packing.spheres;
    const auto count = static_cast<py::ssize_t>(spheres.size());
    py::dict one;
    one["link"] = link.name;
    one["error"] = link.error;
    one["centers"] = make_vectors({count}, [&](std::size_t i) { return spheres[i].center; });
    one["radii"] = make_array<double>({count}, [&](std::size_t i) { return spheres[i].radius; });
    one["max_gap"] = link.packing.certificate.max_gap;
    one["mean_gap"] = link.packing.certificate.mean_gap;
    one["surface_area"] = link.packing.certificate.surface_area;
    one["unreachable_area"] = link.packing.certificate.unreachable_area;
    one["reached"] = link.packing.certificate.reached;
    one["triangles"] = link.solid.triangle_count();
    one["is_closed"] = link.usable() && link.solid.is_closed();
    one["packing_time"] = link.packing_time;
    one["from_cache"] = link.from_cache;
    links.append(one);
  }
  return links;
}

/// Volumes and open edges, one dictionary for each link; samples, so it takes some time.
py::list measure_packing_of(const Robot& robot) {
  py::list links;
  const RobotModel& model = *robot.model();
  for (const LinkModel& link : model.links) {
    PackingReport report;
    std::size_t open = 0;
    {
      const py::gil_scoped_release unlocked;
      if (link.usable()) report = measure_packing(link.solid, link.packing.spheres);
      for (const LinkDescription& one : robot.description().links) {
        if (one.name != link.name) continue;
        for (const GeometryElement& element : one.geometry) {
          const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
          if (mesh != nullptr) open += count_boundary_edges(*mesh);
        }
      }
    }
    py::dict result;
    result["solid_volume"] = report.solid_volume;
    result["filled_volume"] = report.filled_volume;
    result["protrusion"] = report.protrusion;
    result["open_edges"] = open;
    links.append(result);
  }
  return links;
}

py::dict cycle_cost(const Robot& robot, const py::object& given, const PyObstacles& obstacles,
                    int per_cloud, double period, double max_distance, double tolerance,
                    double deadline, double influence_distance) {
  const DoubleArray q = to_numbers(given, "q is an array of numbers");
  check_shape(q, 2, static_cast<py::ssize_t>(robot.joints().size()),
              "q has the shape (n, joints), joints being the number of Robot.joints");
  CycleConfig config;
  config.per_cloud = per_cloud;
  config.period = period;
  config.query.max_distance = max_distance;
  config.query.tolerance = tolerance;
  config.query.deadline = deadline;
  config.repulsion.influence_distance = influence_distance;
  const PointArray points = read_again(obstacles);
  const ObstaclesConfig settings = config_of(obstacles);
  const Span<const double> values(q.data(), static_cast<std::size_t>(q.size()));
  CycleCost cost;
  {
    const py::gil_scoped_release unlocked;
    cost = measure_cycles(robot, values, points.cloud, settings, config);
  }
  py::dict result;
  result["query"] = py::array(py::cast(cost.query));
  result["repulsion"] = py::array(py::cast(cost.repulsion));
  result["width"] = py::array(py::cast(cost.width));
  result["smallest"] = py::array(py::cast(cost.smallest));
  result["unknown"] = py::array(py::cast(cost.unknown));
  return result;
}

}  // namespace

void define_measures(py::class_<Robot>* type) {
  type->def_property_readonly("packing", &packing,
                              "for each link a dictionary: spheres in the link's frame (centers "
                              "(n, 3), radii (n,) [m]), max_gap [m], and more");
  type->def(
      "measure_packing", &measure_packing_of,
      "For each link a dictionary: solid_volume, filled_volume [m^3] and protrusion [m], from "
      "samples, and the number of open_edges of its meshes.");
  const CycleConfig defaults;
  type->def("cycle_cost", &cycle_cost, py::arg("q"), py::arg("obstacles"), py::kw_only(),
            py::arg("per_cloud") = defaults.per_cloud, py::arg("period") = defaults.period,
            py::arg("max_distance") = QueryConfig().max_distance,
            py::arg("tolerance") = QueryConfig().tolerance, py::arg("deadline") = 0.0,
            py::arg("influence_distance") = RepulsionConfig().influence_distance,
            R"(The times of a control loop's cycles along a motion, on one thread of this machine.

q: (n, joints), the motion. obstacles: its points come again as a new cloud every per_cloud cycles,
indexed by another thread. period: [s] of the cycles, between which the thread sleeps; 0: no sleep.
Returns a dictionary of arrays (n,): query and repulsion [s]; width [m], the largest
distance - lower_bound; smallest [m], the smallest lower bound, -inf where a link is unknown; unknown, a number of links.)");
}

}  // namespace ist::python
