#include <pybind11/pybind11.h>

#include "answers.h"
#include "control_classes.h"
#include "extent_class.h"
#include "ist_proximity/geometry/error.h"
#include "obstacles_class.h"
#include "robot_class.h"

PYBIND11_MODULE(_core, module) {
  module.doc() = "Distances from the links of a robot to points, with proven lower bounds.";
  pybind11::register_exception<ist::ModelError>(module, "ModelError", PyExc_RuntimeError);
  ist::python::define_answers(&module);
  ist::python::define_extent(&module);
  ist::python::define_obstacles(&module);
  ist::python::define_robot(&module);
  ist::python::define_control(&module);
}
