#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace ist::test {

/// Reads x, y, z of a binary_compressed PCD file whose fields are all four bytes wide, in file
/// order. Pixels without a measurement are NaN.
/// @throws std::runtime_error
std::vector<Eigen::Vector3f> read_pcd(const std::string& path);

}  // namespace ist::test
