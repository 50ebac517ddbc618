#pragma once

#include <string>

#include "ist_proximity/facade/obstacles.h"

namespace ist {

/// The largest file of points that is read [bytes].
constexpr std::size_t kMaxPointFileSize = std::size_t{1} << 30U;

constexpr const char* kMorePoints = "holds more after the points that its header announces";
constexpr const char* kIntegerCoordinates =
    "has x, y or z as whole numbers, whose unit it does not say; write them as floats in metres";

// PCL's readers take many files that were cut off for whole, crash on others, and print: see
// benchmark/pcl.cpp, which counts them. So the two formats are parsed here.

/// Parses the bytes of a PCD file (version 0.5 to 0.7); `points` are in S.
/// @returns an empty string, or what is wrong: a part of a sentence that begins with the file
std::string parse_pcd(const std::string& bytes, PointFile* file);

/// Parses the bytes of a PLY file (version 1.0).
/// @returns as parse_pcd()
std::string parse_ply(const std::string& bytes, PointFile* file);

}  // namespace ist
