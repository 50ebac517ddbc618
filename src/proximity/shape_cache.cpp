#include "proximity/shape_cache.h"

#include <algorithm>
#include <cstring>
#include <type_traits>
#include <variant>

namespace ist {
namespace {

// FNV-1a, eight bytes at a time.
class Hash {
 public:
  void add(std::uint64_t value) { hash_ = (hash_ ^ value) * 0x100000001B3ULL; }
  void add(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    add(bits ^ (bits >> 32U));
  }
  template <typename Matrix>
  void add_all(const Matrix& matrix) {
    for (Eigen::Index i = 0; i < matrix.size(); ++i) add(matrix.data()[i]);
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0xCBF29CE484222325ULL;
};

void add_shape(const Shape& shape, Hash* hash) {
  hash->add(static_cast<std::uint64_t>(shape.index()));
  std::visit(
      [hash](const auto& one) {
        using T = std::decay_t<decltype(one)>;
        if constexpr (std::is_same_v<T, Box>) {
          hash->add_all(one.size);
        } else if constexpr (std::is_same_v<T, Cylinder>) {
          hash->add(one.radius);
          hash->add(one.length);
        } else if constexpr (std::is_same_v<T, Sphere>) {
          hash->add(one.radius);
        } else {
          for (const Eigen::Vector3d& vertex : one.vertices) hash->add_all(vertex);
          for (const auto& triangle : one.triangles) {
            for (const std::uint32_t corner : triangle) hash->add(std::uint64_t{corner});
          }
        }
      },
      shape);
}

// Bits, so that NaN equals itself and -0 is not 0.
template <typename Vector>
bool is_same(const Vector& a, const Vector& b) {
  return std::memcmp(a.data(), b.data(), static_cast<std::size_t>(a.size()) * sizeof(double)) == 0;
}

bool is_same(const TriangleMesh& a, const TriangleMesh& b) {
  if (a.vertices.size() != b.vertices.size() || a.triangles != b.triangles) return false;
  for (std::size_t i = 0; i < a.vertices.size(); ++i) {
    if (!is_same(a.vertices[i], b.vertices[i])) return false;
  }
  return true;
}

bool is_same(const Shape& a, const Shape& b) {
  if (a.index() != b.index()) return false;
  if (const auto* box = std::get_if<Box>(&a)) return is_same(box->size, std::get<Box>(b).size);
  if (const auto* cylinder = std::get_if<Cylinder>(&a)) {
    const auto& other = std::get<Cylinder>(b);
    return cylinder->radius == other.radius && cylinder->length == other.length;
  }
  if (const auto* sphere = std::get_if<Sphere>(&a)) {
    return sphere->radius == std::get<Sphere>(b).radius;
  }
  return is_same(std::get<TriangleMesh>(a), std::get<TriangleMesh>(b));
}

bool is_same(const LinkGeometry& a, const LinkGeometry& b) {
  if (a.size() != b.size()) return false;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].source != b[i].source || !is_same(a[i].X_LE.matrix(), b[i].X_LE.matrix()) ||
        !is_same(a[i].shape, b[i].shape)) {
      return false;
    }
  }
  return true;
}

// Never different for geometries that are the same.
std::uint64_t geometry_hash(const LinkGeometry& geometry) {
  Hash hash;
  for (const GeometryElement& element : geometry) {
    hash.add_all(element.X_LE.matrix());
    add_shape(element.shape, &hash);
  }
  return hash.value();
}

}  // namespace

std::vector<std::size_t> first_of_same(const std::vector<const LinkGeometry*>& geometries) {
  std::vector<std::size_t> first;
  std::multimap<std::uint64_t, std::size_t> known;
  for (std::size_t i = 0; i < geometries.size(); ++i) {
    const std::uint64_t hash = geometry_hash(*geometries[i]);
    const auto [begin, end] = known.equal_range(hash);
    const auto same = std::find_if(begin, end, [&](const auto& one) {
      return is_same(*geometries[one.second], *geometries[i]);
    });
    first.push_back(same == end ? i : same->second);
    if (same == end) known.insert({hash, i});
  }
  return first;
}

ShapeCache::Entry ShapeCache::find(const LinkGeometry& geometry) const {
  const auto [begin, end] = entries_.equal_range(geometry_hash(geometry));
  for (auto one = begin; one != end; ++one) {
    Entry entry{one->second.geometry.lock(), one->second.shape.lock()};
    if (entry.geometry && entry.shape && is_same(*entry.geometry, geometry)) return entry;
  }
  return {};
}

void ShapeCache::add(const Entry& entry) {
  entries_.insert({geometry_hash(*entry.geometry), {entry.geometry, entry.shape}});
  if (entries_.size() < next_cleaning_) return;
  for (auto one = entries_.begin(); one != entries_.end();) {
    one = one->second.shape.expired() ? entries_.erase(one) : std::next(one);
  }
  next_cleaning_ = 2 * entries_.size() + 64;
}

}  // namespace ist
