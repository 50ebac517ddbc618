#include "internal/geometry/limits.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <sstream>
#include <variant>

namespace ist {
namespace {

std::string mesh_fault(const TriangleMesh& mesh) {
  if (mesh.triangles.size() > kMaxTriangles) {
    return "it has " + std::to_string(mesh.triangles.size()) + " triangles; allowed are at most " +
           std::to_string(kMaxTriangles);
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const std::uint32_t v : mesh.triangles[t]) {
      if (v >= mesh.vertices.size()) {
        return "triangle " + std::to_string(t) + " names vertex " + std::to_string(v) + " of " +
               std::to_string(mesh.vertices.size());
      }
      const Eigen::Vector3d& p = mesh.vertices[v];
      if (!p.allFinite()) return "a corner of triangle " + std::to_string(t) + " is not finite";
      if (p.cwiseAbs().maxCoeff() > kMaxLength) {
        return position_fault("a corner of triangle " + std::to_string(t), p);
      }
    }
  }
  return "";
}

// The first of several faults, or empty.
template <typename... Faults>
std::string first_of(const Faults&... faults) {
  std::string first;
  ((first = first.empty() ? faults : first), ...);
  return first;
}

// The length of the UTF-8 character that begins at `at`, or 0 where there is none (RFC 3629).
std::size_t character_size(const std::string& text, std::size_t at) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const unsigned lead = byte(at);
  if (lead < 0x80U) return 1;
  const std::size_t size = lead >= 0xF0U ? 4 : lead >= 0xE0U ? 3 : 2;
  if (lead < 0xC2U || lead > 0xF4U) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(at + i) & 0xC0U) != 0x80U) return 0;
  }
  const unsigned next = byte(at + 1);  // neither overlong, nor a surrogate, nor too large
  const bool is_wrong = (lead == 0xE0U && next < 0xA0U) || (lead == 0xEDU && next > 0x9FU) ||
                        (lead == 0xF0U && next < 0x90U) || (lead == 0xF4U && next > 0x8FU);
  return is_wrong ? 0 : size;
}

bool is_control(char c) {
  const auto code = static_cast<unsigned char>(c);
  return code < 0x20U || code == 0x7FU;
}

}  // namespace

std::string name_fault(const std::string& name) {
  if (name.empty()) return "is empty";
  if (name.size() > kMaxNameSize) {
    return "has " + std::to_string(name.size()) + " bytes; allowed are at most " +
           std::to_string(kMaxNameSize);
  }
  for (std::size_t at = 0; at < name.size();) {
    const std::size_t size = character_size(name, at);
    if (size == 0) return "is no UTF-8 from byte " + std::to_string(at) + " on";
    if (is_control(name[at])) {
      return "holds the control character " + std::to_string(static_cast<unsigned char>(name[at])) +
             " at byte " + std::to_string(at);
    }
    at += size;
  }
  return "";
}

std::string printable(const std::string& text) {
  std::string result;
  for (std::size_t at = 0; at < text.size();) {
    if (result.size() > kMaxNameSize) return result + "...";
    const std::size_t size = character_size(text, at);
    result += size == 0 || is_control(text[at]) ? "?" : text.substr(at, size);
    at += std::max<std::size_t>(size, 1);
  }
  return result;
}

std::string size_fault(const std::string& what, double value) {
  if (value > 0.0 && value <= kMaxLength) return "";
  std::ostringstream text;
  text << what << " is " << value << " m; allowed is more than 0 and at most " << kMaxLength
       << " m";
  return text.str();
}

std::string scale_fault(const Eigen::Vector3d& scale) {
  const Eigen::Array3d size = scale.array().abs();
  if ((size > 0.0).all() && (size <= kMaxScale).all()) return "";
  std::ostringstream text;
  text << "has the scale (" << scale.x() << " " << scale.y() << " " << scale.z()
       << "); each axis must be finite and not 0 (1 leaves the size as it is), and at most "
       << kMaxScale;
  return text.str();
}

std::string position_fault(const std::string& what, const Eigen::Vector3d& p) {
  if ((p.array().abs() <= kMaxLength).all()) return "";
  std::ostringstream text;
  text << what << " is at (" << p.x() << " " << p.y() << " " << p.z()
       << ") m; allowed are finite coordinates of at most " << kMaxLength << " m";
  return text.str();
}

std::string shape_fault(const Shape& shape) {
  if (const auto* box = std::get_if<Box>(&shape)) {
    return first_of(size_fault("its size along x", box->size.x()),
                    size_fault("its size along y", box->size.y()),
                    size_fault("its size along z", box->size.z()));
  }
  if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    return first_of(size_fault("its radius", cylinder->radius),
                    size_fault("its length", cylinder->length));
  }
  if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    return size_fault("its radius", sphere->radius);
  }
  return mesh_fault(std::get<TriangleMesh>(shape));
}

std::string element_fault(const GeometryElement& element) {
  if (!element.X_LE.matrix().allFinite()) return "its origin is not finite";
  return first_of(position_fault("its origin", element.X_LE.translation()),
                  shape_fault(element.shape));
}

}  // namespace ist
