#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Geometry>
#include <string>
#include <vector>

/// Numpy arrays from and to the library's types. All functions need the GIL.
namespace ist::python {

namespace py = pybind11;

using DoubleArray = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Shape = std::vector<py::ssize_t>;

/// "(3, 4)".
inline std::string to_string(const py::array& array) {
  return py::str(py::tuple(array.attr("shape")));
}

/// Whether it is a str or an os.PathLike.
inline bool is_path(const py::object& path) {
  return py::isinstance<py::str>(path) || py::hasattr(path, "__fspath__");
}

/// The text of a str or of an os.PathLike; raises TypeError for anything else.
inline std::string to_path(const py::object& path) {
  if (!is_path(path)) throw py::type_error("a path is a str or an os.PathLike");
  return py::str(py::module_::import("os").attr("fspath")(path));
}

/// Raises ValueError where the array has not `dimensions` dimensions, the last of size `last`.
inline void check_shape(const py::array& array, py::ssize_t dimensions, py::ssize_t last,
                        const char* what) {
  if (array.ndim() == dimensions && array.shape(dimensions - 1) == last) return;
  throw py::value_error(std::string(what) + "; an array of shape " + to_string(array) +
                        " was given");
}

/// A new array of this shape, filled by value(k) in C order. A shape without dimensions gives a
/// scalar.
template <class T, class Value>
py::object make_array(const Shape& shape, const Value& value) {
  py::array_t<T> array(shape);
  T* data = array.mutable_data();
  for (py::ssize_t k = 0; k < array.size(); ++k) data[k] = value(static_cast<std::size_t>(k));
  if (shape.empty()) return array.attr("item")();
  return array;
}

/// The same with a vector of three numbers for each k: `shape` and one more dimension.
template <class Value>
py::object make_vectors(Shape shape, const Value& value) {
  shape.push_back(3);
  return make_array<double>(
      shape, [&](std::size_t k) { return value(k / 3)[static_cast<Eigen::Index>(k % 3)]; });
}

}  // namespace ist::python
