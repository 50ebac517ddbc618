#pragma once

#include <string>

namespace ist {

/// Checks the lists of indices in a Collada file, which assimp 5 reads without end where one holds
/// anything but whole numbers: one letter, or a decimal point, and memory grows until there is
/// none.
/// @param bytes  the file
/// @returns an empty string, or what is wrong with the file ("holds ... "). A file that is no XML
/// has
///          no fault here; assimp reports it.
std::string collada_fault(const std::string& bytes);

}  // namespace ist
