#pragma once

#include <pybind11/pybind11.h>

namespace ist::python {

/// Defines constraint_rows() and the classes ConstraintRows, VelocityFilter and FilterAnswer.
void define_control(pybind11::module_* module);

}  // namespace ist::python
