#pragma once

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <limits>
#include <map>
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

/// A masked array of numbers with NaN where it is masked, since what lies below a mask is not
/// known; anything else as it is.
inline py::object without_mask(const py::object& given) {
  const PyTypeObject* plain = py::detail::npy_api::get().PyArray_Type_;
  if (!py::isinstance<py::array>(given) || Py_TYPE(given.ptr()) == plain) return given;  // sooner
  if (!py::isinstance(given, py::module_::import("numpy.ma").attr("MaskedArray"))) return given;
  const char kind = py::reinterpret_borrow<py::array>(given).dtype().kind();
  if (std::string("biuf").find(kind) == std::string::npos) return given;
  return given.attr("astype")("f8").attr("filled")(std::numeric_limits<double>::quiet_NaN());
}

/// Makes an array of numbers of what numpy takes for one: NaN where it is masked or None. Raises
/// TypeError for text, complex numbers, times and the like.
/// @param what  "q is an array of numbers"
inline DoubleArray to_numbers(const py::object& given, const char* what) {
  const py::array array = py::array::ensure(without_mask(given));
  const bool may_be = array && std::string("biufO").find(array.dtype().kind()) != std::string::npos;
  const DoubleArray numbers = may_be ? DoubleArray::ensure(array) : DoubleArray();
  if (may_be && numbers) return numbers;
  PyErr_Clear();
  throw py::type_error(
      std::string(what) +
      (array ? "; one of " + std::string(py::str(array.dtype())) + " was given" : ""));
}

/// Positions by joint names. Raises TypeError naming what is no name or no number.
inline std::map<std::string, double> to_positions(const py::dict& given) {
  std::map<std::string, double> positions;
  for (const auto& [joint, position] : given) {
    if (!py::isinstance<py::str>(joint)) {
      throw py::type_error("a joint's name is a str, not " + std::string(py::repr(joint)));
    }
    try {
      positions[py::cast<std::string>(joint)] = py::cast<double>(position);
    } catch (const py::cast_error&) {
      throw py::type_error("the position of joint " + std::string(py::repr(joint)) +
                           " is a number, not " + std::string(py::repr(position)));
    }
  }
  return positions;
}

/// Raises ValueError where the array has not `dimensions` dimensions, the last of size `last`.
inline void check_shape(const py::array& array, py::ssize_t dimensions, py::ssize_t last,
                        const char* what) {
  if (array.ndim() == dimensions && array.shape(dimensions - 1) == last) return;
  throw py::value_error(std::string(what) + "; an array of shape " + to_string(array) +
                        " was given");
}

/// Raises ValueError where the last row of a pose is not (0, 0, 0, 1), as that of a transposed one.
inline void check_last_row(const Eigen::Matrix4d& X, const char* what) {
  const Eigen::RowVector4d off = X.row(3) - Eigen::RowVector4d::Unit(3);
  if (!(off.cwiseAbs().maxCoeff() > 1e-6)) return;  // NaN: not known
  throw py::value_error(std::string(what) +
                        " is not rigid: it is a rotation and a translation, in the last column, "
                        "above a last row of (0, 0, 0, 1)");
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
