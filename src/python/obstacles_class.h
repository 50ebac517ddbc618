#pragma once

#include <pybind11/pybind11.h>

#include "ist_proximity/cloud/ingest.h"
#include "ist_proximity/facade/obstacles.h"

namespace ist::python {

/// Obstacles and the arguments that made them, by which they are pickled.
struct PyObstacles {
  Obstacles obstacles;
  pybind11::object points;   ///< an array of its own
  pybind11::dict arguments;  ///< keyword arguments
};

/// Points in memory, which stay as they are as long as this lives.
struct PointArray {
  pybind11::object array;  ///< (n, 3) or (h, w, 3), of float32 or float64
  RawCloud cloud;          ///< views them, and keeps the array
};

/// The points that an Obstacles object was made of.
PointArray read_again(const PyObstacles& obstacles);
/// The settings that it was made with. A robot among them lives as long as the object.
ObstaclesConfig config_of(const PyObstacles& obstacles);

/// Defines the class Obstacles; Robot is declared.
void define_obstacles(pybind11::module_* module);

}  // namespace ist::python
