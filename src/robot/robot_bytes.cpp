#include "internal/robot/robot_bytes.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/packing/byte_stream.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

// The bytes are: magic, format version, description, packings by link, and a checksum of everything
// before it. The members follow in the order of their structs.
constexpr char kMagic[] = "ISTROBO";  // 8 bytes with its final 0
constexpr std::uint32_t kFormatVersion = 1;
constexpr std::size_t kChecksumSize = 8;

class Writer {
 public:
  void number(double value) { out_.f64(value); }
  void count(std::size_t value) { out_.u64(value); }
  void flag(bool value) { out_.u32(value ? 1 : 0); }
  void kind(std::size_t value) { out_.u32(static_cast<std::uint32_t>(value)); }
  void vector(const Eigen::Vector3d& v) { out_.vector(v); }
  void text(const std::string& value) {
    count(value.size());
    out_.raw(value.data(), value.size());
  }
  void pose(const Eigen::Isometry3d& X) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) number(X(row, column));
    }
  }
  template <class T, class WriteOne>
  void list(const std::vector<T>& values, const WriteOne& write) {
    count(values.size());
    for (const T& value : values) write(value);
  }
  void names(const std::vector<std::string>& values) {
    list(values, [&](const std::string& value) { text(value); });
  }
  std::string finish() {
    out_.u64(out_.hash(0));
    return out_.bytes();
  }
  void begin() {
    out_.raw(kMagic, sizeof(kMagic));
    out_.u32(kFormatVersion);
  }

 private:
  ByteWriter out_;
};

class Reader {
 public:
  explicit Reader(const std::string& bytes) : in_(bytes) {
    if (bytes.size() < sizeof(kMagic) + 4 + kChecksumSize) fail("they are too few");
    left_ = bytes.size() - kChecksumSize;
    ByteReader end(bytes);
    end.raw(left_);
    if (end.u64() != XXH64(bytes.data(), left_, 0)) fail("they were changed or cut off");
    take(sizeof(kMagic) + 4);
    if (in_.raw(sizeof(kMagic)) != std::string(kMagic, sizeof(kMagic))) fail("they are no robot");
    const std::uint32_t version = in_.u32();
    if (version != kFormatVersion) {
      fail("their format version is " + std::to_string(version) + ", not " +
           std::to_string(kFormatVersion) + "; use the same release on both sides");
    }
  }

  double number() {
    take(8);
    return in_.f64();
  }
  /// A number of elements, each of which takes at least `size` bytes.
  std::size_t count(std::size_t size) {
    take(8);
    const std::uint64_t value = in_.u64();
    if (value > left_ / size) fail("they end early");
    return static_cast<std::size_t>(value);
  }
  std::uint32_t kind() {
    take(4);
    return in_.u32();
  }
  bool flag() { return kind() != 0; }
  Eigen::Vector3d vector() {
    Eigen::Vector3d v;
    for (int k = 0; k < 3; ++k) v[k] = number();
    return v;
  }
  std::string text() {
    const std::size_t size = count(1);
    take(size);
    return in_.raw(size);
  }
  Eigen::Isometry3d pose() {
    Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) X(row, column) = number();
    }
    return X;
  }
  template <class T, class ReadOne>
  std::vector<T> list(std::size_t size, const ReadOne& read) {
    std::vector<T> values(count(size));
    for (T& value : values) value = read();
    return values;
  }
  std::vector<std::string> names() {
    return list<std::string>(8, [this] { return text(); });
  }
  [[noreturn]] static void fail(const std::string& why) {
    throw ModelError("the bytes of a robot cannot be read: " + why);
  }

 private:
  void take(std::size_t size) {
    if (size > left_) fail("they end early");
    left_ -= size;
  }

  ByteReader in_;
  std::size_t left_ = 0;
};

void write(const Shape& shape, Writer* out) {
  out->kind(shape.index());
  if (const auto* box = std::get_if<Box>(&shape)) {
    out->vector(box->size);
  } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    out->number(cylinder->radius);
    out->number(cylinder->length);
  } else if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    out->number(sphere->radius);
  } else {
    const auto& mesh = std::get<TriangleMesh>(shape);
    out->list(mesh.vertices, [&](const Eigen::Vector3d& v) { out->vector(v); });
    out->list(mesh.triangles, [&](const TriangleMesh::Triangle& triangle) {
      for (const std::uint32_t corner : triangle) out->kind(corner);
    });
  }
}

Shape read_shape(Reader* in) {
  static_assert(std::is_same_v<Shape, std::variant<Box, Cylinder, Sphere, TriangleMesh>>);
  switch (in->kind()) {
    case 0:
      return Box{in->vector()};
    case 1: {
      const double radius = in->number();
      return Cylinder{radius, in->number()};
    }
    case 2:
      return Sphere{in->number()};
    case 3: {
      TriangleMesh mesh;
      mesh.vertices = in->list<Eigen::Vector3d>(24, [in] { return in->vector(); });
      mesh.triangles = in->list<TriangleMesh::Triangle>(12, [in, &mesh] {
        TriangleMesh::Triangle triangle;
        for (std::uint32_t& corner : triangle) {
          corner = in->kind();
          if (corner >= mesh.vertices.size()) Reader::fail("a triangle names no vertex");
        }
        return triangle;
      });
      return mesh;
    }
    default:
      Reader::fail("a shape is of no known kind");
  }
}

void write(const LinkDescription& link, Writer* out) {
  out->text(link.name);
  out->list(link.geometry, [out](const GeometryElement& element) {
    write(element.shape, out);
    out->pose(element.X_LE);
    out->text(element.source);
  });
  out->text(link.error);
  out->count(link.attached);
  out->flag(link.used_visual_fallback);
}

LinkDescription read_link(Reader* in) {
  LinkDescription link;
  link.name = in->text();
  link.geometry = in->list<GeometryElement>(4, [in] {
    GeometryElement element;
    element.shape = read_shape(in);
    element.X_LE = in->pose();
    element.source = in->text();
    const std::string fault = element_fault(element);
    if (!fault.empty()) Reader::fail(fault);
    return element;
  });
  link.error = in->text();
  link.attached = in->count(1);
  if (link.attached > link.geometry.size()) Reader::fail("a link has too few elements");
  link.used_visual_fallback = in->flag();
  return link;
}

void write(const JointDescription& joint, Writer* out) {
  out->text(joint.name);
  out->kind(static_cast<std::size_t>(joint.type));
  out->text(joint.parent_link);
  out->text(joint.child_link);
  out->pose(joint.X_PJ);
  out->vector(joint.axis);
  out->flag(joint.mimic.has_value());
  if (joint.mimic) {
    out->text(joint.mimic->joint);
    out->number(joint.mimic->multiplier);
    out->number(joint.mimic->offset);
  }
  out->number(joint.lower);
  out->number(joint.upper);
  out->number(joint.speed);
}

JointDescription read_joint(Reader* in) {
  JointDescription joint;
  joint.name = in->text();
  const std::uint32_t type = in->kind();
  if (type > static_cast<std::uint32_t>(JointType::kFloating)) {
    Reader::fail("a joint is of no known type");
  }
  joint.type = static_cast<JointType>(type);
  joint.parent_link = in->text();
  joint.child_link = in->text();
  joint.X_PJ = in->pose();
  joint.axis = in->vector();
  if (in->flag()) {
    Mimic mimic;
    mimic.joint = in->text();
    mimic.multiplier = in->number();
    mimic.offset = in->number();
    joint.mimic = mimic;
  }
  joint.lower = in->number();
  joint.upper = in->number();
  joint.speed = in->number();
  return joint;
}

void write(const Packing& packing, Writer* out) {
  out->list(packing.spheres, [out](const InnerSphere& sphere) {
    out->vector(sphere.center);
    out->number(sphere.radius);
    out->number(sphere.cover_radius);
  });
  const PackingCertificate& certificate = packing.certificate;
  for (const double value : {certificate.max_gap, certificate.mean_gap, certificate.interior_gap,
                             certificate.unreachable_area, certificate.surface_area}) {
    out->number(value);
  }
  out->flag(certificate.reached);
}

Packing read_packing(Reader* in) {
  Packing packing;
  packing.spheres = in->list<InnerSphere>(40, [in] {
    InnerSphere sphere;
    sphere.center = in->vector();
    sphere.radius = in->number();
    sphere.cover_radius = in->number();
    const bool is_sound = sphere.center.allFinite() && std::isfinite(sphere.radius) &&
                          std::isfinite(sphere.cover_radius) && sphere.cover_radius >= 0.0 &&
                          sphere.cover_radius >= sphere.radius;
    if (!is_sound) Reader::fail("a sphere is not valid");
    return sphere;
  });
  PackingCertificate& certificate = packing.certificate;
  for (double* value : {&certificate.max_gap, &certificate.mean_gap, &certificate.interior_gap,
                        &certificate.unreachable_area, &certificate.surface_area}) {
    *value = in->number();
    if (!(*value >= 0.0 && std::isfinite(*value))) Reader::fail("a certificate is not valid");
  }
  certificate.reached = in->flag();
  return packing;
}

void write(const LinkModel& link, Writer* out) {
  out->text(link.name);
  out->text(link.error);
  if (link.usable()) write(link.packing, out);
}

LinkModel read_link_model(const RobotDescription& description, Reader* in) {
  LinkModel link;
  link.name = in->text();
  link.error = in->text();
  if (!link.usable()) return link;
  link.packing = read_packing(in);
  link.from_cache = true;
  for (const LinkDescription& one : description.links) {
    if (one.name != link.name) continue;
    if (link.packing.spheres.empty()) Reader::fail("link '" + link.name + "' has no spheres");
    link.tree = InnerSphereTree(link.packing);
    link.solid = Solid(one.geometry);
    return link;
  }
  Reader::fail("link '" + link.name + "' has no shapes");
}

}  // namespace

std::string serialize_robot(const RobotParts& robot) {
  Writer out;
  out.begin();
  const RobotDescription& description = robot.description;
  out.text(description.name);
  out.text(description.root_link);
  out.list(description.links, [&](const LinkDescription& link) { write(link, &out); });
  out.names(description.links_without_geometry);
  out.names(description.link_order);
  out.list(description.joints, [&](const JointDescription& joint) { write(joint, &out); });
  out.list(robot.model->links, [&](const LinkModel& link) { write(link, &out); });
  return out.finish();
}

RobotParts parse_robot(const std::string& bytes) {
  Reader in(bytes);
  RobotParts robot;
  RobotDescription& description = robot.description;
  description.name = in.text();
  description.root_link = in.text();
  description.links = in.list<LinkDescription>(8, [&] { return read_link(&in); });
  description.links_without_geometry = in.names();
  description.link_order = in.names();
  description.joints = in.list<JointDescription>(8, [&] { return read_joint(&in); });
  auto model = std::make_shared<RobotModel>();
  model->name = description.name;
  model->root_link = description.root_link;
  model->links = in.list<LinkModel>(16, [&] { return read_link_model(description, &in); });
  robot.model = std::move(model);
  return robot;
}

}  // namespace ist
