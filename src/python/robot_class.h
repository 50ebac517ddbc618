#pragma once

#include <pybind11/pybind11.h>

namespace ist::python {

/// Defines the class Robot; Obstacles and the answers are defined.
void define_robot(pybind11::module_* module);

}  // namespace ist::python
