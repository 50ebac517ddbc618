#pragma once

#include <pybind11/pybind11.h>

#include "ist_proximity/cloud/point_extent.h"

namespace ist::python {

/// An Extent, or a radius [m] that all points have.
/// @throws py::type_error for anything else
ExtentConfig to_extent(const pybind11::object& extent);

/// Defines the class Extent.
void define_extent(pybind11::module_* module);

}  // namespace ist::python
