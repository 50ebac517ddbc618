#include "packing_file.h"

#include <cmath>
#include <cstdint>

#include "internal/packing/byte_stream.h"

namespace ist {
namespace {

// A file holds: magic, format version, key, sphere count, certificate, spheres, and a checksum of
// everything before it. Integers and doubles are little-endian.
constexpr char kMagic[] = "ISTPACK";  // 8 bytes with its final 0
constexpr std::uint32_t kFormatVersion = 1;
constexpr std::size_t kDouble = 8;
constexpr std::size_t kHeaderSize = sizeof(kMagic) + 4 + kPackingKeySize + 8 + 5 * kDouble + 4;
constexpr std::size_t kSphereSize = 5 * kDouble;
constexpr std::size_t kChecksumSize = 8;

bool is_length(double value) { return std::isfinite(value) && value >= 0.0; }

bool is_sound(const PackingCertificate& certificate) {
  return is_length(certificate.max_gap) && is_length(certificate.mean_gap) &&
         is_length(certificate.interior_gap) && is_length(certificate.unreachable_area) &&
         is_length(certificate.surface_area);
}

bool is_sound(const InnerSphere& sphere) {
  return sphere.center.allFinite() && std::isfinite(sphere.radius) &&
         is_length(sphere.cover_radius) && sphere.cover_radius >= sphere.radius;
}

}  // namespace

std::size_t packing_file_size(std::size_t spheres) {
  return kHeaderSize + kSphereSize * spheres + kChecksumSize;
}

std::string serialize_packing(const std::string& key, const Packing& packing) {
  ByteWriter out;
  out.reserve(packing_file_size(packing.spheres.size()));
  out.raw(kMagic, sizeof(kMagic));
  out.u32(kFormatVersion);
  out.raw(key.data(), key.size());
  out.u64(packing.spheres.size());
  const PackingCertificate& certificate = packing.certificate;
  out.f64(certificate.max_gap);
  out.f64(certificate.mean_gap);
  out.f64(certificate.interior_gap);
  out.f64(certificate.unreachable_area);
  out.f64(certificate.surface_area);
  out.u32(certificate.reached ? 1 : 0);
  for (const InnerSphere& sphere : packing.spheres) {
    out.vector(sphere.center);
    out.f64(sphere.radius);
    out.f64(sphere.cover_radius);
  }
  out.u64(out.hash(0));
  return out.bytes();
}

std::string parse_packing(const std::string& bytes, const std::string& key, Packing* packing) {
  if (bytes.size() < kHeaderSize + kChecksumSize) return "it is too short";
  ByteReader in(bytes);
  if (in.raw(sizeof(kMagic)) != std::string(kMagic, sizeof(kMagic))) return "it is no such file";
  const std::uint32_t version = in.u32();
  if (version != kFormatVersion) {
    return "its format version is " + std::to_string(version) + ", not " +
           std::to_string(kFormatVersion);
  }
  if (in.raw(kPackingKeySize) != key) return "it holds another packing";
  const std::uint64_t count = in.u64();
  const std::size_t payload = bytes.size() - kHeaderSize - kChecksumSize;
  if (payload % kSphereSize != 0 || payload / kSphereSize != count) {
    return "its size does not fit the " + std::to_string(count) + " spheres it announces";
  }
  ByteReader end(bytes);
  end.raw(bytes.size() - kChecksumSize);
  if (end.u64() != XXH64(bytes.data(), bytes.size() - kChecksumSize, 0)) {
    return "its checksum is wrong";
  }
  PackingCertificate& certificate = packing->certificate;
  certificate.max_gap = in.f64();
  certificate.mean_gap = in.f64();
  certificate.interior_gap = in.f64();
  certificate.unreachable_area = in.f64();
  certificate.surface_area = in.f64();
  certificate.reached = in.u32() != 0;
  if (!is_sound(certificate)) return "its certificate is not finite";
  packing->spheres.reserve(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    InnerSphere sphere;
    for (int k = 0; k < 3; ++k) sphere.center[k] = in.f64();
    sphere.radius = in.f64();
    sphere.cover_radius = in.f64();
    if (!is_sound(sphere)) return "its sphere " + std::to_string(i) + " is not valid";
    packing->spheres.push_back(sphere);
  }
  return packing->spheres.empty() ? "it holds no sphere" : "";
}

}  // namespace ist
