// The PLY format: http://paulbourke.net/dataformats/ply/

#include <algorithm>
#include <array>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/cloud/ingest.h"
#include "number_format.h"
#include "point_file.h"
#include "text_scanner.h"

namespace ist {
namespace {

struct Property {
  std::string name;
  bool is_list = false;
  NumberFormat length;  // of a list
  NumberFormat value;
};

struct Element {
  std::string name;
  std::size_t count = 0;
  std::vector<Property> properties;
};

struct PlyHeader {
  std::string encoding;
  std::vector<Element> elements;
};

bool parse_format(const std::string& name, NumberFormat* format) {
  using Kind = NumberFormat::Kind;
  static const std::map<std::string, NumberFormat> kFormats = {
      {"char", {Kind::kSigned, 1, false}},     {"int8", {Kind::kSigned, 1, false}},
      {"uchar", {Kind::kUnsigned, 1, false}},  {"uint8", {Kind::kUnsigned, 1, false}},
      {"short", {Kind::kSigned, 2, false}},    {"int16", {Kind::kSigned, 2, false}},
      {"ushort", {Kind::kUnsigned, 2, false}}, {"uint16", {Kind::kUnsigned, 2, false}},
      {"int", {Kind::kSigned, 4, false}},      {"int32", {Kind::kSigned, 4, false}},
      {"uint", {Kind::kUnsigned, 4, false}},   {"uint32", {Kind::kUnsigned, 4, false}},
      {"float", {Kind::kFloat, 4, false}},     {"float32", {Kind::kFloat, 4, false}},
      {"double", {Kind::kFloat, 8, false}},    {"float64", {Kind::kFloat, 8, false}}};
  const auto found = kFormats.find(name);
  if (found == kFormats.end()) return false;
  *format = found->second;
  return true;
}

std::string read_property(const std::vector<std::string>& words, PlyHeader* header) {
  Property property;
  property.is_list = words.size() == 5 && words[1] == "list";
  const std::size_t last = words.size() - 1;
  bool is_known = !header->elements.empty() && (property.is_list || words.size() == 3);
  if (property.is_list) is_known = is_known && parse_format(words[2], &property.length);
  is_known = is_known && parse_format(words[last - 1], &property.value);
  if (!is_known) return "has a line 'property' that is not understood";
  property.name = words[last];
  header->elements.back().properties.push_back(property);
  return "";
}

std::string read_ply_header(TextScanner* in, PlyHeader* header) {
  const std::vector<std::string> magic = in->at_end() ? std::vector<std::string>() : in->words();
  if (magic.size() != 1 || magic[0] != "ply") return "is no PLY file: its first line is not 'ply'";
  while (!in->at_end()) {
    const std::vector<std::string> words = in->words();
    if (words.empty() || words[0] == "comment" || words[0] == "obj_info") continue;
    if (words[0] == "end_header") return "";
    std::string problem;
    if (words[0] == "format" && words.size() == 3) {
      header->encoding = words[1];
    } else if (words[0] == "element" && words.size() == 3) {
      Element element{words[1], 0, {}};
      if (!parse_count(words[2], 1000000000, &element.count)) problem = "has a wrong 'element'";
      header->elements.push_back(element);
    } else if (words[0] == "property") {
      problem = read_property(words, header);
    } else {
      problem = "has a line '" + printable(words[0]) + "' that is not understood";
    }
    if (!problem.empty()) return problem;
  }
  return "ends before its line 'end_header'";
}

/// Reads the numbers of a file one after the other.
class NumberReader {
 public:
  NumberReader(const std::string& bytes, TextScanner in, const std::string& encoding)
      : bytes_(bytes),
        in_(in),
        at_(in.at()),
        is_ascii_(encoding == "ascii"),
        is_big_endian_(encoding == "binary_big_endian") {}

  bool read(NumberFormat format, double* value) {
    if (is_ascii_) {
      const bool is_there = in_.number(value);
      *value = format.nearest(*value);
      return is_there;
    }
    if (bytes_.size() - at_ < format.size) return false;
    format.is_big_endian = is_big_endian_;
    *value = format.read(bytes_.data() + at_);
    at_ += format.size;
    return true;
  }

  /// Whether no number is left. Fewer bytes than three of the shortest coordinates are no point.
  bool at_end() {
    return is_ascii_ ? in_.only_space_left() : bytes_.size() - at_ < 3 * sizeof(float);
  }

 private:
  const std::string& bytes_;
  TextScanner in_;
  std::size_t at_;
  bool is_ascii_, is_big_endian_;
};

/// The properties x, y and z of an element; -1 where it has none.
std::array<int, 3> coordinates(const Element& element) {
  std::array<int, 3> xyz = {-1, -1, -1};
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    if (property.is_list || property.name.size() != 1) continue;
    const int k = property.name[0] - 'x';
    if (k >= 0 && k < 3) xyz[static_cast<std::size_t>(k)] = static_cast<int>(i);
  }
  return xyz;
}

/// Reads one instance of an element.
/// @param values  one for each property; a list leaves 0
bool read_instance(const Element& element, NumberReader* in, std::vector<double>* values) {
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const Property& property = element.properties[i];
    double value = 0.0;
    if (!property.is_list) {
      if (!in->read(property.value, &value)) return false;
      (*values)[i] = value;
      continue;
    }
    double length = 0.0;
    if (!in->read(property.length, &length) || length < 0.0) return false;
    for (double k = 0.0; k < length; ++k) {
      if (!in->read(property.value, &value)) return false;
    }
  }
  return true;
}

std::string read_vertices(const Element& element, NumberReader* in, PointFile* file) {
  const std::array<int, 3> xyz = coordinates(element);
  if (xyz[0] < 0 || xyz[1] < 0 || xyz[2] < 0) return "has vertices without x, y and z";
  for (const int k : xyz) {
    const NumberFormat& format = element.properties[static_cast<std::size_t>(k)].value;
    if (format.kind != NumberFormat::Kind::kFloat) return kIntegerCoordinates;
  }
  const std::size_t most = IngestConfig().max_points;
  if (element.count > most) {
    return "has " + std::to_string(element.count) + " vertices; at most " + std::to_string(most) +
           " are read";
  }
  std::vector<double> values(element.properties.size());
  for (std::size_t i = 0; i < element.count; ++i) {
    if (!read_instance(element, in, &values)) {
      return "is cut off or damaged in vertex " + std::to_string(i) + " of " +
             std::to_string(element.count);
    }
    file->points.emplace_back(values[static_cast<std::size_t>(xyz[0])],
                              values[static_cast<std::size_t>(xyz[1])],
                              values[static_cast<std::size_t>(xyz[2])]);
  }
  file->width = element.count;
  file->height = 1;
  return "";
}

/// Whether a camera is elsewhere than at the origin, or turned, by the names that PCL and MeshLab
/// give its pose.
bool is_moved_camera(const Element& element, const std::vector<double>& values) {
  static const std::map<std::string, double> kAtOrigin = {
      {"view_px", 0.0}, {"view_py", 0.0}, {"view_pz", 0.0}, {"x_axisx", 1.0},
      {"x_axisy", 0.0}, {"x_axisz", 0.0}, {"y_axisx", 0.0}, {"y_axisy", 1.0},
      {"y_axisz", 0.0}, {"z_axisx", 0.0}, {"z_axisy", 0.0}, {"z_axisz", 1.0}};
  if (element.name != "camera") return false;
  for (std::size_t i = 0; i < element.properties.size(); ++i) {
    const auto place = kAtOrigin.find(element.properties[i].name);
    if (place != kAtOrigin.end() && values[i] != place->second) return true;
  }
  return false;
}

std::string skip(const Element& element, NumberReader* in) {
  if (element.properties.empty()) return "";
  std::vector<double> values(element.properties.size());
  for (std::size_t i = 0; i < element.count; ++i) {
    if (!read_instance(element, in, &values)) {
      return "is cut off or damaged in its element '" + printable(element.name) + "'";
    }
    if (is_moved_camera(element, values)) {
      return "has a camera that is not at the origin: PCL writes points in its frame, others do "
             "not. Write a PCD file, which states the frame, or a PLY file without a camera";
    }
  }
  return "";
}

/// Whether instances of it name vertices: faces and edges, by the names that programs give them.
bool joins_vertices(const Element& element) {
  // A scan's grid names the vertex of each pixel.
  if (element.name == "vertex" || element.name == "range_grid") return false;
  if (element.name == "face" || element.name == "tristrips") return true;
  const auto names_vertex = [](const Property& one) { return one.name.rfind("vertex", 0) == 0; };
  return std::any_of(element.properties.begin(), element.properties.end(), names_vertex);
}

std::string check_elements(const std::vector<Element>& elements) {
  std::size_t vertices = 0;
  for (const Element& element : elements) {
    vertices += element.name == "vertex" ? 1 : 0;
    if (element.count > 0 && joins_vertices(element)) {
      return "has " + std::to_string(element.count) + " of the element '" +
             printable(element.name) +
             "': obstacles are points, and those of a surface would be its corners only. Sample " +
             "the surface, or state it as a mesh of a known world";
    }
  }
  if (vertices == 1) return "";
  return vertices == 0 ? "has no element 'vertex'" : "has more than one element 'vertex'";
}

}  // namespace

std::string parse_ply(const std::string& bytes, PointFile* file) {
  TextScanner in(bytes);
  PlyHeader header;
  std::string problem = read_ply_header(&in, &header);
  if (!problem.empty()) return problem;
  if (header.encoding != "ascii" && header.encoding != "binary_little_endian" &&
      header.encoding != "binary_big_endian") {
    return "has the format '" + printable(header.encoding) + "', which is not read";
  }
  problem = check_elements(header.elements);
  if (!problem.empty()) return problem;
  NumberReader numbers(bytes, in, header.encoding);
  for (const Element& element : header.elements) {
    problem =
        element.name == "vertex" ? read_vertices(element, &numbers, file) : skip(element, &numbers);
    if (!problem.empty()) return problem;
  }
  return numbers.at_end() ? "" : kMorePoints;
}

}  // namespace ist
