#include <cstdio>
#include <variant>

#include "internal/packing/byte_stream.h"
#include "internal/packing/packer.h"
#include "internal/packing/packing_cache.h"
#include "packing_file.h"

namespace ist {
namespace {

struct ShapeWriter {
  ByteWriter* out;

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

}  // namespace

std::string packing_key(const Shape& shape, const PackingConfig& config) {
  ByteWriter out;
  out.u32(static_cast<std::uint32_t>(kPackingVersion));
  out.f64(config.max_error);
  out.u64(static_cast<std::uint64_t>(config.max_spheres));
  out.u32(static_cast<std::uint32_t>(config.order));
  std::visit(ShapeWriter{&out}, shape);
  char text[kPackingKeySize + 1];
  std::snprintf(text, sizeof(text), "%016llx%016llx", static_cast<unsigned long long>(out.hash(1)),
                static_cast<unsigned long long>(out.hash(2)));
  return text;
}

}  // namespace ist
