#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace ist::test {

/// The content of a NumPy array file: little-endian float32 or float64, C order.
struct Npy {
  std::vector<std::size_t> shape;
  std::vector<double> values;
};

/// @throws std::runtime_error when the file is not such an array.
Npy read_npy(const std::string& path);

}  // namespace ist::test
