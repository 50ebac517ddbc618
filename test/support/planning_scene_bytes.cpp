#include "support/planning_scene_bytes.h"

#include <cstring>

namespace ist::test {
namespace {

// Serializes fields, little-endian.
class WireWriter {
 public:
  WireWriter& u8(unsigned value) {
    bytes.push_back(static_cast<std::uint8_t>(value));
    return *this;
  }
  WireWriter& u32(std::size_t value) {
    for (unsigned k = 0; k < 4; ++k) u8(static_cast<unsigned>(value >> (8 * k)) & 0xFFU);
    return *this;
  }
  WireWriter& f64(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    u32(bits & 0xFFFFFFFFU);
    return u32(bits >> 32U);
  }
  WireWriter& string(const std::string& text) {
    u32(text.size());
    bytes.insert(bytes.end(), text.begin(), text.end());
    return *this;
  }
  WireWriter& strings(const std::vector<std::string>& texts) {
    u32(texts.size());
    for (const std::string& text : texts) string(text);
    return *this;
  }
  WireWriter& header(const std::string& frame) { return u32(7).u32(1).u32(2).string(frame); }
  WireWriter& pose(const std::array<double, 7>& p_q) {
    for (const double value : p_q) f64(value);
    return *this;
  }
  WireWriter& append(const std::vector<std::uint8_t>& more) {
    bytes.insert(bytes.end(), more.begin(), more.end());
    return *this;
  }

  std::vector<std::uint8_t> bytes;
};

}  // namespace

std::vector<std::uint8_t> WireObject::bytes(SceneLayout layout) const {
  WireWriter out;
  const auto poses = [&](const std::vector<WirePose>& all) {
    out.u32(all.size());
    for (const WirePose& one : all) out.pose(one);
  };
  out.header(frame);
  if (layout == SceneLayout::kObjectPose) out.pose(pose);
  out.string(id).string("key").string("database");
  out.u32(primitives.size());
  for (const Primitive& primitive : primitives) {
    out.u8(primitive.type).u32(primitive.dimensions.size());
    for (const double size : primitive.dimensions) out.f64(size);
  }
  poses(primitive_poses);
  out.u32(meshes.size());
  for (const Mesh& mesh : meshes) {
    out.u32(mesh.triangles.size());
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t corner : triangle) out.u32(corner);
    }
    out.u32(mesh.vertices.size());
    for (const auto& vertex : mesh.vertices) {
      for (const double value : vertex) out.f64(value);
    }
  }
  poses(mesh_poses);
  out.u32(planes.size());
  for (const auto& plane : planes) {
    for (const double value : plane) out.f64(value);
  }
  poses(plane_poses);
  if (layout == SceneLayout::kObjectPose) {
    out.strings({"tip"});
    poses({kIdentityPose});
  }
  out.u8(operation);
  return out.bytes;
}

WireObject box_object(const std::string& id, const WirePose& pose, double edge) {
  WireObject object;
  object.frame = "world";
  object.id = id;
  object.primitives = {{1, {edge, edge, edge}}};
  object.primitive_poses = {pose};
  return object;
}

WireOctomap one_leaf(double resolution) {
  WireOctomap octomap;
  octomap.id = "OcTree";
  octomap.resolution = resolution;
  WireWriter out;
  out.u8(0).u8(0xC0);  // the root: its last child is an inner node
  for (int depth = 1; depth < 15; ++depth) out.u8(3).u8(0);  // these: their first child is
  octomap.data = out.u8(2).u8(0).bytes;  // the last one: its first child is occupied
  return octomap;
}

std::vector<std::uint8_t> WireScene::bytes(SceneLayout layout) const {
  WireWriter out;
  out.string("scene");
  out.header("base").strings({"a", "b"});
  for (int k = 0; k < 3; ++k) out.u32(2).f64(1.0).f64(2.0);
  out.header("base").strings({"floating"}).u32(1).pose(kIdentityPose);
  for (int k = 0; k < 2; ++k) out.u32(1).pose(kIdentityPose).bytes.resize(out.bytes.size() - 8);
  out.u32(attached.size());
  for (const WireObject& object : attached) {
    out.string("hand").append(object.bytes(layout)).strings({"finger"});
    out.header("").strings({"finger_joint"}).u32(1);
    for (int k = 0; k < 4; ++k) out.u32(1).f64(0.5);
    out.u32(1).u32(0).f64(0.3);
  }
  out.u8(is_state_diff ? 1 : 0).string("robot");
  out.u32(1).header("world").string("map").pose(kIdentityPose);
  out.strings(matrix_names).u32(matrix.size());
  for (const std::vector<int>& row : matrix) {
    out.u32(row.size());
    for (const int value : row) out.u8(static_cast<unsigned>(value));
  }
  out.strings({"link"}).u32(1).u8(1);
  for (int k = 0; k < 2; ++k) out.u32(1).string("link").f64(0.01);
  out.u32(1).string("object").u32(0).u32(0).u32(0).u32(0);
  out.u32(objects.size());
  for (const WireObject& object : objects) out.append(object.bytes(layout));
  out.header(octomap.frame).pose(octomap.origin).header("unused").u8(octomap.is_binary ? 1 : 0);
  out.string(octomap.id).f64(octomap.resolution);
  out.u32(octomap.data.size()).append(octomap.data);
  out.u8(is_diff ? 1 : 0);
  return out.bytes;
}

}  // namespace ist::test
