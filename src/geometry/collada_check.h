#pragma once

#include <string>

namespace ist {

/// Checks what assimp 5 takes on trust in a Collada file, and does not survive: XML that
/// is not well-formed, which it reads all the same; indices that are no
/// whole numbers (memory grows until there is none), accessors that read past their array (it
/// crashes) and fewer lists of indices than announced (it ends the program).
/// @param bytes  the file
/// @returns an empty string, or what is wrong with the file ("holds ...", "cannot be read ...")
std::string collada_fault(const std::string& bytes);

}  // namespace ist
