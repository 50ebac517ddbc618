#include "geometry/mesh_file_checks.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <utility>

namespace ist {
namespace {

constexpr std::array<const char*, 5> kFormats = {"stl", "dae", "obj", "ply", "off"};

std::string lower_case(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text;
}

// Whether the last statement of a piece of STL text ends a solid.
bool ends_solid(std::string text) {
  std::replace(text.begin(), text.end(), '\r', '\n');
  bool ends = false;
  std::istringstream lines(lower_case(text));
  for (std::string line; std::getline(lines, line);) {
    std::string word, next;
    std::istringstream(line) >> word >> next;
    if (word == "endsolid" || (word == "end" && next == "solid")) ends = true;
    if (word == "solid" || word == "facet" || word == "vertex") ends = false;
  }
  return ends;
}

std::string too_many(double count, const std::string& what, std::size_t bytes) {
  if (count <= static_cast<double>(bytes)) return "";
  std::ostringstream text;
  text << "announces " << count << " " << what << " in a file of " << bytes
       << " bytes; it is damaged, export or download it again";
  return text.str();
}

// Lines "element vertex 1000000000".
std::string ply_fault(const std::string& head, std::size_t size) {
  std::istringstream lines(head);
  for (std::string line; std::getline(lines, line) && line.rfind("end_header", 0) != 0;) {
    std::istringstream words(line);
    std::string keyword, name;
    double count = 0.0;
    if (!(words >> keyword >> name >> count) || keyword != "element") continue;
    std::string fault = too_many(count, "elements '" + name + "'", size);
    if (!fault.empty()) return fault;
  }
  return "";
}

// "OFF", then the numbers of vertices, faces and edges, with comments in between.
std::string off_fault(const std::string& head, std::size_t size) {
  std::istringstream lines(head);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    for (std::string word; words >> word;) {
      std::istringstream number(word);
      double count = 0.0;
      if (!(number >> count)) continue;
      std::string fault = too_many(count, "vertices or faces", size);
      if (!fault.empty()) return fault;
    }
  }
  return "";
}

// Binary files may begin with "solid", too. The last byte of the number of facets is 0 in them, as
// no file is large enough for 16 million; a text has no zeros.
bool is_binary_stl(const std::string& bytes) {
  return bytes.size() >= kStlHead && bytes[kStlHead - 1] == '\0';
}

std::size_t announced_facets(const std::string& bytes) {
  std::uint32_t facets = 0;
  std::memcpy(&facets, &bytes[kStlHead - sizeof facets], sizeof facets);
  return facets;
}

}  // namespace

std::string mesh_format(const std::string& path) {
  const std::string extension = lower_case(std::filesystem::path(path).extension().string());
  return extension.empty() ? extension : extension.substr(1);
}

std::string format_fault(const std::string& format) {
  std::string known;
  for (const char* name : kFormats) {
    if (format == name) return "";
    known += (known.empty() ? "" : ", ") + std::string(name);
  }
  return "cannot be read as a mesh: its name ends in '." + format + "'; known are " + known;
}

std::string normalize_stl(std::string* bytes) {
  constexpr std::size_t kTail = 4096;
  if (is_binary_stl(*bytes)) {
    const std::size_t facets = announced_facets(*bytes), size = kStlHead + kStlFacet * facets;
    if (bytes->size() < size || bytes->size() >= size + kStlFacet) {
      return "announces " + std::to_string(facets) + " facets, which take " + std::to_string(size) +
             " bytes, and has " + std::to_string(bytes->size()) +
             (bytes->size() < size ? ": it is cut off" : ": it is damaged, or of several parts") +
             "; export or download it again";
    }
    bytes->resize(size);
    return "";
  }
  if (lower_case(bytes->substr(0, 5)) != "solid") return "";
  *bytes = lower_case(std::move(*bytes));  // assimp knows keywords of small letters only
  if (ends_solid(bytes->substr(bytes->size() - std::min(kTail, bytes->size())))) return "";
  return "is cut off: an STL file that begins with 'solid' ends with 'endsolid'; export or "
         "download it again";
}

std::size_t binary_stl_facets(const std::string& bytes) {
  return is_binary_stl(bytes) ? announced_facets(bytes) : 0;
}

std::string declared_size_fault(const std::string& format, const std::string& bytes) {
  constexpr std::size_t kHead = 65536;
  const std::string head = bytes.substr(0, kHead);
  if (format == "ply") return ply_fault(head, bytes.size());
  if (format == "off") return off_fault(head.substr(0, 512), bytes.size());
  return "";
}

}  // namespace ist
