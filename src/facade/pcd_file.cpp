// The PCD format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "internal/geometry/limits.h"
#include "ist_proximity/cloud/ingest.h"
#include "number_format.h"
#include "point_file.h"
#include "text_scanner.h"

namespace ist {
namespace {

struct Field {
  std::string name;
  NumberFormat format;
  std::size_t count = 1;   // numbers
  std::size_t offset = 0;  // [bytes] within a point
  std::size_t column = 0;  // of its first number, in an ascii file
};

struct Header {
  std::set<std::string> keys;  // of the lines that were read
  std::vector<std::string> names, sizes, types, counts;
  std::size_t width = 0, height = 0, points = 0;
  bool has_points = false;
  Eigen::Isometry3d X_QS = Eigen::Isometry3d::Identity();  // VIEWPOINT: the sensor's pose
  std::string encoding;

  std::vector<Field> fields;
  std::size_t point_size = 0;  // [bytes]
  std::size_t columns = 0;
};

constexpr std::size_t kMaxFields = 1000;
constexpr std::size_t kMaxColumns = 100000;

/// VIEWPOINT tx ty tz qw qx qy qz.
std::string read_viewpoint(const std::vector<std::string>& values, Eigen::Isometry3d* X_QS) {
  std::array<double, 7> v{};
  bool is_known = values.size() == v.size();
  for (std::size_t i = 0; is_known && i < v.size(); ++i) {
    TextScanner in(values[i]);
    is_known = in.number(&v[i]) && in.at_end();
  }
  const Eigen::Quaterniond q(v[3], v[4], v[5], v[6]);
  const Eigen::Vector3d p(v[0], v[1], v[2]);
  // Writers round the quaternion to six digits or so.
  is_known = is_known && std::abs(q.norm() - 1.0) < 1e-3 && (p.array().abs() <= kMaxLength).all();
  if (!is_known) return "has a VIEWPOINT that is no position within 10 km and unit quaternion";
  *X_QS = Eigen::Translation3d(p) * q.normalized();
  return "";
}

std::string read_line(const std::vector<std::string>& words, Header* header) {
  const std::string& key = words[0];
  const std::vector<std::string> values(words.begin() + 1, words.end());
  const std::size_t most = IngestConfig().max_points;
  const auto read_count = [&](std::size_t* value) -> std::string {
    if (values.size() == 1 && parse_count(values[0], most, value)) return "";
    return "has a " + key + " that is no number up to " + std::to_string(most);
  };
  if (!header->keys.insert(key).second) return "has two lines " + printable(key);
  if (key == "FIELDS" || key == "COLUMNS") header->names = values;
  if (key == "SIZE") header->sizes = values;
  if (key == "TYPE") header->types = values;
  if (key == "COUNT") header->counts = values;
  if (key == "VIEWPOINT") return read_viewpoint(values, &header->X_QS);
  if (key == "WIDTH") return read_count(&header->width);
  if (key == "HEIGHT") return read_count(&header->height);
  if (key == "POINTS") {
    header->has_points = true;
    return read_count(&header->points);
  }
  if (key == "DATA") header->encoding = values.empty() ? "?" : values[0];
  static const std::set<std::string> kOthers = {"VERSION", "FIELDS", "COLUMNS", "SIZE",
                                                "TYPE",    "COUNT",  "DATA"};
  if (kOthers.count(key) == 0) return "has a line '" + printable(key) + "' that is not understood";
  return "";
}

std::string read_fields(Header* header) {
  const std::size_t n = header->names.size();
  if (n == 0 || n > kMaxFields) return "names no fields, or more than a thousand";
  if (header->counts.empty()) header->counts.assign(n, "1");
  if (header->sizes.size() != n || header->types.size() != n || header->counts.size() != n) {
    return "has as many FIELDS as it has not of SIZE, TYPE or COUNT";
  }
  for (std::size_t i = 0; i < n; ++i) {
    Field field;
    field.name = header->names[i];
    const std::string& type = header->types[i];
    field.format.kind = type == "F"   ? NumberFormat::Kind::kFloat
                        : type == "I" ? NumberFormat::Kind::kSigned
                                      : NumberFormat::Kind::kUnsigned;
    const bool is_known = type == "F" || type == "I" || type == "U";
    if (!is_known || !parse_count(header->sizes[i], 8, &field.format.size) ||
        !field.format.is_valid() || !parse_count(header->counts[i], kMaxColumns, &field.count) ||
        header->columns + field.count > kMaxColumns) {
      return "has a field '" + printable(field.name) + "' of TYPE " + printable(type) + ", SIZE " +
             printable(header->sizes[i]) + ", COUNT " + printable(header->counts[i]);
    }
    field.offset = header->point_size;
    field.column = header->columns;
    header->point_size += field.count * field.format.size;
    header->columns += field.count;
    header->fields.push_back(field);
  }
  return "";
}

std::string read_header(TextScanner* in, Header* header) {
  while (header->encoding.empty()) {
    if (in->at_end()) return "ends before a line DATA";
    const std::vector<std::string> words = in->words();
    if (words.empty() || words[0][0] == '#') continue;
    std::string problem = read_line(words, header);
    if (!problem.empty()) return problem;
  }
  if (header->width == 0 && header->height == 0) header->width = header->points;
  if (header->height == 0) header->height = 1;
  const std::size_t size = header->width * header->height;
  if (size > IngestConfig().max_points || (header->has_points && header->points != size)) {
    return "has WIDTH " + std::to_string(header->width) + ", HEIGHT " +
           std::to_string(header->height) + " and POINTS " + std::to_string(header->points) +
           ", which do not fit, or are more than " + std::to_string(IngestConfig().max_points);
  }
  return read_fields(header);
}

/// The fields x, y and z.
std::string find_coordinates(const std::vector<Field>& fields, std::array<Field, 3>* xyz) {
  const std::array<std::string, 3> names = {"x", "y", "z"};
  for (std::size_t k = 0; k < 3; ++k) {
    std::size_t found = 0;
    for (const Field& field : fields) {
      if (field.name != names[k] || field.count != 1) continue;
      (*xyz)[k] = field;
      ++found;
    }
    if (found != 1) return "has no field " + names[k] + ", or more than one";
    if ((*xyz)[k].format.kind != NumberFormat::Kind::kFloat) return kIntegerCoordinates;
  }
  return "";
}

/// LZF as PCL writes it. @returns false where the data are damaged
bool decompress(const char* in, std::size_t in_size, std::size_t out_size, std::string* out) {
  out->clear();
  out->reserve(out_size);
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(in[i]); };
  for (std::size_t i = 0; i < in_size;) {
    const std::size_t control = byte(i++);
    if (control < 32) {  // control + 1 bytes as they are
      if (i + control + 1 > in_size || out->size() + control + 1 > out_size) return false;
      out->append(in + i, control + 1);
      i += control + 1;
      continue;
    }
    std::size_t length = control >> 5U;
    if (length == 7) {
      if (i >= in_size) return false;
      length += byte(i++);
    }
    if (i >= in_size) return false;
    const std::size_t back = ((control & 31U) << 8U) + byte(i++) + 1;
    length += 2;
    if (back > out->size() || out->size() + length > out_size) return false;
    for (std::size_t k = 0; k < length; ++k) out->push_back((*out)[out->size() - back]);
  }
  return out->size() == out_size;
}

std::string read_ascii(const Header& header, const std::array<Field, 3>& xyz, TextScanner* in,
                       PointFile* file) {
  std::vector<double> row(header.columns);
  for (std::size_t i = 0; i < header.width * header.height; ++i) {
    for (double& value : row) {
      if (!in->number(&value)) {
        return "has no number where one of point " + std::to_string(i) + " should be, in line " +
               std::to_string(in->line() + 1);
      }
    }
    const auto at = [&](const Field& field) { return field.format.nearest(row[field.column]); };
    file->points.emplace_back(at(xyz[0]), at(xyz[1]), at(xyz[2]));
  }
  return in->only_space_left() ? "" : kMorePoints;
}

/// @param position  [bytes] of a field of point i in `data`
template <class Position>
void read_binary(std::size_t count, const std::array<Field, 3>& xyz, const char* data,
                 const Position& position, PointFile* file) {
  for (std::size_t i = 0; i < count; ++i) {
    Eigen::Vector3d p;
    for (std::size_t k = 0; k < 3; ++k) {
      p[static_cast<Eigen::Index>(k)] = xyz[k].format.read(data + position(xyz[k], i));
    }
    file->points.push_back(p);
  }
}

std::string read_compressed(const Header& header, const std::array<Field, 3>& xyz,
                            const std::string& bytes, std::size_t begin, PointFile* file) {
  const NumberFormat size_format{NumberFormat::Kind::kUnsigned, 4, false};
  if (bytes.size() - begin < 8) return "is cut off";
  const auto packed = static_cast<std::size_t>(size_format.read(bytes.data() + begin));
  const auto size = static_cast<std::size_t>(size_format.read(bytes.data() + begin + 4));
  const std::size_t count = header.width * header.height;
  if (packed > bytes.size() - begin - 8) return "is cut off";
  std::string data;
  if (size != count * header.point_size || size > kMaxPointFileSize ||
      !decompress(bytes.data() + begin + 8, packed, size, &data)) {
    return "has compressed data that are damaged";
  }
  // The first field of all points comes first, then the second of all.
  const auto position = [&](const Field& field, std::size_t i) {
    return field.offset * count + i * field.format.size;
  };
  read_binary(count, xyz, data.data(), position, file);
  return "";
}

std::string read_body(const Header& header, const std::array<Field, 3>& xyz,
                      const std::string& bytes, TextScanner in, PointFile* file) {
  const std::size_t count = header.width * header.height;
  if (header.encoding == "ascii") return read_ascii(header, xyz, &in, file);
  if (header.encoding == "binary_compressed") {
    return read_compressed(header, xyz, bytes, in.at(), file);
  }
  if (header.encoding != "binary") return "has DATA " + printable(header.encoding);
  if ((bytes.size() - in.at()) / header.point_size < count) {
    return "is cut off: " + std::to_string(count) + " points of " +
           std::to_string(header.point_size) + " bytes should follow its header, and there are " +
           std::to_string(bytes.size() - in.at()) + " bytes";
  }
  if ((bytes.size() - in.at()) / header.point_size > count) return kMorePoints;
  const auto position = [&](const Field& field, std::size_t i) {
    return i * header.point_size + field.offset;
  };
  read_binary(count, xyz, bytes.data() + in.at(), position, file);
  return "";
}

}  // namespace

std::string parse_pcd(const std::string& bytes, PointFile* file) {
  TextScanner in(bytes);
  Header header;
  std::string problem = read_header(&in, &header);
  std::array<Field, 3> xyz;
  if (problem.empty()) problem = find_coordinates(header.fields, &xyz);
  if (!problem.empty()) return problem;
  file->width = header.width;
  file->height = header.height;
  file->X_QS = header.X_QS;
  return read_body(header, xyz, bytes, in, file);
}

}  // namespace ist
