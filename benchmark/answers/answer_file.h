#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"

/// Answers and packings as text that holds every bit of them.
namespace ist::benchmark {

/// A hexadecimal float. The sign and payload of NaN mean nothing and are left out.
inline std::string hex(double value) {
  if (std::isnan(value)) return "nan";
  char text[40];
  std::snprintf(text, sizeof text, "%a", value);
  return text;
}

inline std::string hex(const Eigen::Vector3d& v) {
  return hex(v.x()) + " " + hex(v.y()) + " " + hex(v.z());
}

/// Writes to a file that it does not own.
class AnswerFile {
 public:
  explicit AnswerFile(std::FILE* file) : file_(file) {}

  void line(const std::string& text) { std::fprintf(file_, "%s\n", text.c_str()); }

  void answer(const std::string& name, const LinkProximity& link) {
    line(name + ": " + std::to_string(static_cast<int>(link.state)) + " " + hex(link.distance) +
         " " + hex(link.lower_bound) + " | " + hex(link.p_FCl) + " | " + hex(link.p_LCl) + " | " +
         hex(link.p_FCo) + " | " + hex(link.direction) + " | " + std::to_string(link.source) + " " +
         std::to_string(link.point));
  }

  void answers(const std::string& name, bool complete, const std::vector<LinkProximity>& links) {
    for (std::size_t i = 0; i < links.size(); ++i) {
      answer(name + (complete ? " link " : " incomplete link ") + std::to_string(i), links[i]);
    }
  }

  void minimum(const std::string& name, const RobotProximity& robot) {
    answer(name + " minimum " + std::to_string(robot.link) + (robot.all_known ? "" : " of some"),
           robot.nearest);
  }

 private:
  std::FILE* file_;
};

/// FNV-1a over the numbers' bytes.
class Hash {
 public:
  void add(double value) {
    unsigned char bytes[sizeof value];
    std::memcpy(bytes, &value, sizeof value);
    for (const unsigned char byte : bytes) hash_ = (hash_ ^ byte) * 1099511628211U;
  }
  std::string text() const { return std::to_string(hash_); }

 private:
  std::uint64_t hash_ = 14695981039346656037U;
};

inline void write_packing(const std::string& name, const Packing& packing, AnswerFile* out) {
  Hash hash;
  for (const auto& sphere : packing.spheres) {
    for (const double value : sphere.center) hash.add(value);
    hash.add(sphere.radius);
    hash.add(sphere.cover_radius);
  }
  const PackingCertificate& certificate = packing.certificate;
  out->line("packing " + name + ": " + std::to_string(packing.spheres.size()) + " spheres " +
            hash.text() + " gap " + hex(certificate.max_gap) + " " + hex(certificate.mean_gap) +
            " " + hex(certificate.interior_gap) + " area " + hex(certificate.surface_area) + " " +
            hex(certificate.unreachable_area));
}

}  // namespace ist::benchmark
