#pragma once

#include <pybind11/pybind11.h>

#include <vector>

#include "arrays.h"
#include "ist_proximity/proximity/proximity_query.h"

/// Answers as numpy arrays.
namespace ist::python {

/// The answers of all links, of one configuration (shape (links,)) or many ((n, links)).
struct Distances {
  py::object state, distance, lower_bound, point, p_FCl, p_LCl, p_FCo, direction;
};

/// The nearest link, of one configuration (scalars) or many ((n,)).
struct Nearest {
  py::object link, all_known;
  Distances answer;
};

/// @param shape  of each array; vectors have one more dimension
Distances to_arrays(const std::vector<LinkProximity>& answers, const Shape& shape);
Nearest to_arrays(const std::vector<RobotProximity>& answers, const Shape& shape);

/// Defines the classes Distances and Nearest, and the constants of `state`.
void define_answers(py::module_* module);

}  // namespace ist::python
