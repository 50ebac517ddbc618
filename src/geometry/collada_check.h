#pragma once

#include <string>

namespace ist {

/// Checks what assimp 5 takes on trust in a Collada file, and does not survive: XML that
/// is not well-formed, which it reads all the same; indices that are no
/// whole numbers (memory grows until there is none), accessors that read past their array (it
/// crashes), fewer lists of indices than announced and skews (they end the program); and parts that
/// are named and missing, which it leaves out.
/// @param bytes     the file
/// @param readable  may be null, or `bytes`; written where primitives with a count of 0 have to be
///                  taken out for assimp
/// @param unit      may be null; receives the text of <unit meter="...">, empty where there is none
/// @returns an empty string, or what is wrong with the file ("holds ...", "cannot be read ...")
std::string collada_fault(const std::string& bytes, std::string* readable = nullptr,
                          std::string* unit = nullptr);

}  // namespace ist
