#include "field_cache.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <vector>

#include "internal/geometry/regular_file.h"
#include "internal/packing/byte_stream.h"
#include "internal/packing/packing_cache.h"

namespace ist {

// Raise it whenever the same geometry gets another field.
constexpr std::uint32_t kFieldVersion = 1;
constexpr char kMagic[] = "ISTFELD";  // 8 bytes with its final 0
// Longer files are no fields: those of large solids have some megabytes.
constexpr std::size_t kMaxFileSize = std::size_t{1} << 26U;

/// The bytes of a field's file: magic, key, members, checksum of everything before it.
class FieldFile {
 public:
  static std::string write(const std::string& key, const DistanceField& field) {
    ByteWriter out;
    out.raw(kMagic, sizeof(kMagic));
    out.raw(key.data(), key.size());
    out.u32(field.is_closed_ ? 1 : 0);
    out.f64(static_cast<double>(field.surface_step_));
    out.vector(field.bounds_.min().cast<double>());
    out.vector(field.bounds_.max().cast<double>());
    write(field.depths_, &out);
    out.u64(field.levels_.size());
    for (const DistanceField::Level& level : field.levels_) write(level, &out);
    write_all(field.values_, &out);
    write_all(field.outside_, &out);
    write_all(field.surface_xy_, &out);
    write_all(field.surface_z_ball_, &out);
    out.u64(out.hash(0));
    return out.bytes();
  }

  // @param fault  why the bytes cannot be used
  // @returns null with a fault
  static std::shared_ptr<const DistanceField> read(const std::string& bytes, const std::string& key,
                                                   std::string* fault) {
    const std::string head = std::string(kMagic, sizeof(kMagic)) + key;
    const bool is_field =
        bytes.size() > head.size() + kFixedSize && bytes.compare(0, head.size(), head) == 0;
    *fault = is_field ? "its checksum is wrong" : "it is of another format, or is truncated";
    if (!is_field) return nullptr;
    const std::size_t payload = bytes.size() - 8;
    ByteReader end(bytes);
    end.raw(payload);
    if (end.u64() != XXH64(bytes.data(), payload, 0)) return nullptr;
    *fault = "its sizes do not fit one another";
    ByteReader in(bytes);
    in.raw(head.size());
    const std::shared_ptr<DistanceField> field(new DistanceField);
    field->is_closed_ = in.u32() != 0;
    field->surface_step_ = static_cast<float>(in.f64());
    read(&in, &field->bounds_.min());
    read(&in, &field->bounds_.max());
    read(&in, &field->depths_);
    const std::uint64_t levels = in.u64();
    if (levels > in.left() / kLevelSize) return nullptr;
    field->levels_.resize(levels);
    for (DistanceField::Level& level : field->levels_) read(&in, &level);
    const bool fits = read_all(&in, &field->values_) && read_all(&in, &field->outside_) &&
                      read_all(&in, &field->surface_xy_) &&
                      read_all(&in, &field->surface_z_ball_) && are_consistent(*field);
    if (!fits) return nullptr;
    fault->clear();
    return field;
  }

 private:
  static void write(const DistanceField::Level& level, ByteWriter* out) {
    for (const float low : level.low) out->f64(static_cast<double>(low));
    out->f64(static_cast<double>(level.cell));
    for (const std::int32_t size : level.size) out->u32(static_cast<std::uint32_t>(size));
    out->u64(level.first);
  }
  static void read(ByteReader* in, DistanceField::Level* level) {
    for (float& low : level->low) low = static_cast<float>(in->f64());
    level->cell = static_cast<float>(in->f64());
    level->per_cell = 1.0F / level->cell;
    for (std::int32_t& size : level->size) size = static_cast<std::int32_t>(in->u32());
    level->first = in->u64();
  }
  static void read(ByteReader* in, Eigen::Vector3f* v) {
    for (int axis = 0; axis < 3; ++axis) (*v)[axis] = static_cast<float>(in->f64());
  }
  template <class Value>
  static void write_all(const std::vector<Value>& values, ByteWriter* out) {
    out->u64(values.size());
    for (const Value value : values) out->integer(value, sizeof(Value));
  }
  // @returns false where there are fewer bytes than values
  template <class Value>
  static bool read_all(ByteReader* in, std::vector<Value>* values) {
    if (in->left() < 8) return false;
    const std::uint64_t count = in->u64();
    if (count > in->left() / sizeof(Value)) return false;
    values->resize(count);
    for (Value& value : *values) value = static_cast<Value>(in->integer(sizeof(Value)));
    return true;
  }
  static bool are_consistent(const DistanceField& field) {
    constexpr std::size_t kPadding = DistanceField::kPadding;
    std::size_t nodes = 0;
    for (const DistanceField::Level& level : field.levels_) {
      if (!is_sound(level) || level.first != nodes) return false;
      nodes += level.count();
    }
    const std::size_t finest = field.levels_.empty() ? 0 : field.levels_.front().count();
    const std::size_t depths = field.surface_xy_.size();
    return field.values_.size() == nodes + kPadding && field.outside_.size() == finest + kPadding &&
           field.surface_z_ball_.size() == depths &&
           (depths == 0 || (is_sound(field.depths_) && field.depths_.count() == depths));
  }
  static bool is_sound(const DistanceField::Level& level) {
    const auto fits = [](std::int32_t size) { return size >= 2 && size < (1 << 20); };
    return std::isfinite(level.cell) && level.cell > 0.0F &&
           std::all_of(level.size, level.size + 3, fits);
  }

  static constexpr std::size_t kLevelSize = 4 * 8 + 3 * 4 + 8;
  static constexpr std::size_t kFixedSize = 4 + 8 + 6 * 8 + kLevelSize + 8 + 8;
};

std::string field_key(const LinkGeometry& geometry) {
  ByteWriter out;
  out.u32(kFieldVersion);
  for (const GeometryElement& element : geometry) {
    const std::string shape = packing_key(element.shape, {});
    out.raw(shape.data(), shape.size());
    for (int column = 0; column < 4; ++column) {
      out.vector(element.X_LE.matrix().col(column).head<3>());
    }
  }
  char text[33];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(out.hash(1)),
                static_cast<unsigned long long>(out.hash(2)));
  return text;
}

std::string FieldCache::path(const std::string& key) const {
  return (std::filesystem::path(directory_) / (key + ".istfield")).string();
}

std::shared_ptr<const DistanceField> FieldCache::load(const std::string& key, const Solid& solid,
                                                      std::string* warning) const {
  std::error_code error;
  if (directory_.empty() || (!std::filesystem::exists(path(key), error) && !error)) return nullptr;
  std::string bytes;
  std::string problem = read_regular_file(path(key), kMaxFileSize, &bytes);
  if (!problem.empty()) problem = "it " + problem;
  std::shared_ptr<const DistanceField> field;
  if (problem.empty()) field = FieldFile::read(bytes, key, &problem);
  if (problem.empty()) problem = field_fault(*field, solid);
  if (problem.empty()) return field;
  *warning = "the file of distances '" + path(key) + "' is not used: " + problem;
  return nullptr;
}

void FieldCache::store(const std::string& key, const DistanceField& field,
                       std::string* warning) const {
  if (directory_.empty() || field.empty()) return;
  const std::string problem = write_cache_file(directory_, path(key), FieldFile::write(key, field));
  if (problem.empty()) return;
  *warning = "the file of distances '" + path(key) + "' cannot be written (" + problem +
             "); they will be measured again next time";
}

}  // namespace ist
