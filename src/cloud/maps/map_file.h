#pragma once

#include <cstddef>
#include <string>

namespace ist {

/// Reads a whole file. Only a regular file is read: a FIFO or a device could block, or never end.
/// @param max_bytes  a larger file is refused before it is read
/// @returns an empty string, or why it cannot be read, to follow "map file 'x' "
std::string read_map_bytes(const std::string& path, std::size_t max_bytes, std::string* bytes);

}  // namespace ist
