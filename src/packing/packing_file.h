#pragma once

#include <cstddef>
#include <string>

#include "ist_proximity/packing/packing.h"

namespace ist {

/// The number of characters of a packing's key.
constexpr std::size_t kPackingKeySize = 32;

/// How long the file of a packing of so many spheres is.
std::size_t packing_file_size(std::size_t spheres);

/// The bytes of a packing's file.
/// @param key  kPackingKeySize characters
std::string serialize_packing(const std::string& key, const Packing& packing);

/// Reads the bytes of a packing's file, and checks all of them.
/// @param packing  overwritten; undefined where there is a fault
/// @returns an empty string, or why the bytes are not a packing of this key
std::string parse_packing(const std::string& bytes, const std::string& key, Packing* packing);

}  // namespace ist
