#pragma once

#include <pybind11/pybind11.h>

#include "ist_proximity/facade/robot.h"

namespace ist::python {

/// Defines what is measured of a Robot: its packing, and the time of a control loop's cycles.
void define_measures(pybind11::class_<Robot>* type);

}  // namespace ist::python
