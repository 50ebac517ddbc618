#pragma once

#include <cstddef>
#include <string>

/// Checks of a mesh file's bytes before assimp reads them. Each returns an empty string, or what is
/// wrong with the file: the predicate of a sentence, such as "is cut off".
namespace ist {

/// "stl" for "LINK.STL".
std::string mesh_format(const std::string& path);

/// Assimp reads some forty formats, most of which robots do not use and nobody checks. The others
/// are refused.
std::string format_fault(const std::string& format);

/// Makes of an STL file what assimp reads: keywords of small letters, nothing after a binary file's
/// facets. A text must end with 'endsolid': assimp accepts half a file, and half a link would be an
/// unsafe link.
std::string normalize_stl(std::string* bytes);

/// The facets of a binary STL file that normalize_stl() has passed; 0: it is a text, or has none.
/// Each takes kStlFacet bytes, from kStlHead on: 12 bytes of a normal, 9 floats, 2 bytes.
std::size_t binary_stl_facets(const std::string& bytes);
constexpr std::size_t kStlHead = 84, kStlFacet = 50, kStlNormal = 12;

/// PLY and OFF files begin with the numbers of their elements, for which assimp takes memory before
/// it reads them. A file cannot hold more elements than bytes.
std::string declared_size_fault(const std::string& format, const std::string& bytes);

}  // namespace ist
