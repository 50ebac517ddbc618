#pragma once

#include <cstddef>
#include <string>

#include "internal/geometry/cancelled.h"

namespace ist {

/// Reads a whole file. Only regular files are read: a FIFO or a device would block, or never end.
/// @param max_size  [bytes] of the largest file that is read
/// @param bytes     overwritten; undefined where there is a fault
/// @returns an empty string, or why it is not read, as "is a directory": a part of a sentence
/// @throws Cancelled
std::string read_regular_file(const std::string& path, std::size_t max_size, std::string* bytes,
                              const CancelRequest& cancelled = {});

}  // namespace ist
