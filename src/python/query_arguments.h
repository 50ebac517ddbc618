#pragma once

#include <pybind11/pybind11.h>

#include <string>

namespace ist::python {

/// Raises ValueError for a range beyond all points that there can be: sums with it are no numbers.
inline void check_max_distance(double max_distance, double margin) {
  constexpr double kFarthest = 1e10;  // [m]
  if (!(max_distance > kFarthest) && !(margin > kFarthest)) return;
  const auto text = [](double value) {
    return std::string(pybind11::repr(pybind11::float_(value))) + " m";
  };
  throw pybind11::value_error("max_distance is " + text(max_distance) + " and margin " +
                              text(margin) +
                              "; they must be at most 1e10 m: no point is farther away");
}

}  // namespace ist::python
