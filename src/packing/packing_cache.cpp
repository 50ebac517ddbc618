#include "internal/packing/packing_cache.h"

#include <fcntl.h>
#include <unistd.h>
#include <xxhash.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <variant>

#include "internal/packing/packer.h"

namespace ist {
namespace {

namespace fs = std::filesystem;

// A file: magic, format version, key, sphere count, certificate, spheres, checksum of all before
// it. Integers and doubles are little-endian.
constexpr char kMagic[] = "ISTPACK";  // with its final 0: 8 bytes
constexpr std::uint32_t kFormatVersion = 1;
constexpr std::size_t kKeySize = 32;
constexpr std::size_t kDouble = 8;
constexpr std::size_t kHeaderSize = sizeof(kMagic) + 4 + kKeySize + 8 + 5 * kDouble + 4;
constexpr std::size_t kSphereSize = 5 * kDouble;
constexpr std::size_t kChecksumSize = 8;
constexpr std::streamoff kMaxFileSize = 1LL << 32;

class Writer {
 public:
  void u32(std::uint32_t value) { integer(value, 4); }
  void u64(std::uint64_t value) { integer(value, 8); }
  void f64(double value) {
    std::uint64_t bits;
    const double canonical = value + 0.0;  // one zero, not two
    std::memcpy(&bits, &canonical, sizeof(bits));
    u64(bits);
  }
  void vector(const Eigen::Vector3d& v) {
    for (int i = 0; i < 3; ++i) f64(v[i]);
  }
  void raw(const char* data, std::size_t size) { bytes_.append(data, size); }
  void reserve(std::size_t size) { bytes_.reserve(size); }

  std::uint64_t hash(std::uint64_t seed) const { return XXH64(bytes_.data(), bytes_.size(), seed); }
  const std::string& bytes() const { return bytes_; }

 private:
  void integer(std::uint64_t value, int size) {
    for (int i = 0; i < size; ++i) bytes_.push_back(static_cast<char>((value >> (8 * i)) & 0xFFU));
  }

  std::string bytes_;
};

// Reads what Writer wrote; the caller has checked that enough is there.
class Reader {
 public:
  explicit Reader(const std::string& bytes) : bytes_(bytes) {}

  std::uint32_t u32() { return static_cast<std::uint32_t>(integer(4)); }
  std::uint64_t u64() { return integer(8); }
  double f64() {
    const std::uint64_t bits = u64();
    double value;
    std::memcpy(&value, &bits, sizeof(value));
    return value;
  }
  std::string raw(std::size_t size) {
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }

 private:
  std::uint64_t integer(int size) {
    std::uint64_t value = 0;
    for (int i = 0; i < size; ++i) {
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes_[at_++])) << (8 * i);
    }
    return value;
  }

  const std::string& bytes_;
  std::size_t at_ = 0;
};

struct ShapeWriter {
  Writer* out;

  void operator()(const Box& box) const {
    out->u32(1);
    out->vector(box.size);
  }
  void operator()(const Cylinder& cylinder) const {
    out->u32(2);
    out->f64(cylinder.radius);
    out->f64(cylinder.length);
  }
  void operator()(const Sphere& sphere) const {
    out->u32(3);
    out->f64(sphere.radius);
  }
  void operator()(const TriangleMesh& mesh) const {
    out->reserve(24 * mesh.vertices.size() + 12 * mesh.triangles.size() + 64);
    out->u32(4);
    out->u64(mesh.vertices.size());
    out->u64(mesh.triangles.size());
    for (const Eigen::Vector3d& v : mesh.vertices) out->vector(v);
    for (const TriangleMesh::Triangle& t : mesh.triangles) {
      for (const std::uint32_t corner : t) out->u32(corner);
    }
  }
};

std::string serialized(const std::string& key, const Packing& packing) {
  Writer out;
  out.reserve(kHeaderSize + kSphereSize * packing.spheres.size() + kChecksumSize);
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

// Why the bytes are no packing of this key; empty when they are.
std::string parse(const std::string& bytes, const std::string& key, Packing* packing) {
  if (bytes.size() < kHeaderSize + kChecksumSize) return "it is too short";
  Reader in(bytes);
  if (in.raw(sizeof(kMagic)) != std::string(kMagic, sizeof(kMagic))) return "it is no such file";
  const std::uint32_t version = in.u32();
  if (version != kFormatVersion) {
    return "its format version is " + std::to_string(version) + ", not " +
           std::to_string(kFormatVersion);
  }
  if (in.raw(kKeySize) != key) return "it holds another packing";
  const std::uint64_t count = in.u64();
  const std::size_t payload = bytes.size() - kHeaderSize - kChecksumSize;
  if (payload % kSphereSize != 0 || payload / kSphereSize != count) {
    return "its size does not fit the " + std::to_string(count) + " spheres it announces";
  }
  Reader end(bytes);
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

// Writes and syncs a new file, so that after the rename it is whole even if the power fails.
// Why it could not be done; empty when it was.
std::string write_synced(const std::string& path, const std::string& bytes) {
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (file < 0) return std::strerror(errno);
  std::string problem;
  std::size_t written = 0;
  while (written < bytes.size() && problem.empty()) {
    const ssize_t n = write(file, bytes.data() + written, bytes.size() - written);
    if (n >= 0) {
      written += static_cast<std::size_t>(n);
    } else if (errno != EINTR) {
      problem = std::strerror(errno);
    }
  }
  if (problem.empty() && fsync(file) != 0) problem = std::strerror(errno);
  if (close(file) != 0 && problem.empty()) problem = std::strerror(errno);
  return problem;
}

// A name that no other process uses, no other thread of this one, and none that died with it.
std::string temporary_name(const std::string& path) {
  static std::atomic<unsigned> counter{0};
  const auto now = std::chrono::system_clock::now().time_since_epoch().count();
  return path + "." + std::to_string(getpid()) + "." + std::to_string(counter++) + "." +
         std::to_string(now) + ".tmp";
}

}  // namespace

std::string default_cache_directory() {
  const char* ros_home = std::getenv("ROS_HOME");
  if (ros_home != nullptr && *ros_home != '\0') return std::string(ros_home) + "/ist_proximity";
  const char* home = std::getenv("HOME");
  if (home == nullptr || *home == '\0') return {};
  return std::string(home) + "/.ros/ist_proximity";
}

std::string packing_key(const Shape& shape, const PackingConfig& config) {
  Writer out;
  out.u32(static_cast<std::uint32_t>(kPackingVersion));
  out.f64(config.max_error);
  out.u64(static_cast<std::uint64_t>(config.max_spheres));
  out.u32(static_cast<std::uint32_t>(config.order));
  std::visit(ShapeWriter{&out}, shape);
  char text[kKeySize + 1];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(out.hash(1)),
                static_cast<unsigned long long>(out.hash(2)));
  return text;
}

std::string PackingCache::path(const std::string& key) const {
  return (fs::path(directory_) / (key + ".istpack")).string();
}

std::optional<Packing> PackingCache::load(const std::string& key, std::string* warning) const {
  if (directory_.empty()) return std::nullopt;
  const std::string file_name = path(key);
  std::error_code error;
  if (!fs::exists(file_name, error) && !error) return std::nullopt;
  std::string problem, bytes;
  // The size of what was opened: another process may put a new file in its place meanwhile.
  std::ifstream file(file_name, std::ios::binary | std::ios::ate);
  const std::streamoff size = file ? static_cast<std::streamoff>(file.tellg()) : -1;
  if (size < 0 || !fs::is_regular_file(file_name, error)) {
    problem = "it cannot be read";
  } else if (size > kMaxFileSize) {
    problem = "it is absurdly large";
  } else {
    bytes.resize(static_cast<std::size_t>(size));
    file.seekg(0);
    file.read(bytes.data(), size);
    if (!file) problem = "it cannot be read";
  }
  Packing packing;
  if (problem.empty()) problem = parse(bytes, key, &packing);
  if (problem.empty()) return packing;
  *warning = "packing cache file '" + file_name + "' is not used: " + problem;
  return std::nullopt;
}

bool PackingCache::store(const std::string& key, const Packing& packing,
                         std::string* warning) const {
  if (directory_.empty()) return true;
  const std::string file_name = path(key);
  const std::string temporary = temporary_name(file_name);
  std::error_code error;
  fs::create_directories(directory_, error);
  std::string problem = error ? error.message() : write_synced(temporary, serialized(key, packing));
  if (problem.empty()) {
    fs::rename(temporary, file_name, error);
    if (!error) return true;
    problem = error.message();
  }
  unlink(temporary.c_str());
  *warning = "packing cache file '" + file_name + "' cannot be written (" + problem +
             "); the packing will be computed again next time";
  return false;
}

}  // namespace ist
