#pragma once

#include <pybind11/pybind11.h>

#include "ist_proximity/facade/obstacles.h"

namespace ist::python {

/// Obstacles and the arguments that made them, by which they are pickled.
struct PyObstacles {
  Obstacles obstacles;
  pybind11::object points;   ///< the array or path
  pybind11::dict arguments;  ///< keyword arguments
};

/// Defines the class Obstacles; Robot is declared.
void define_obstacles(pybind11::module_* module);

}  // namespace ist::python
