#include "internal/proximity/planning_scene.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "internal/geometry/limits.h"
#include "ist_proximity/proximity/world_file.h"
#include "proximity/planning_scene_fields.h"
#include "proximity/wire_reader.h"

namespace ist {
namespace {

constexpr std::size_t kPointSize = 24, kTriangleSize = 12;  // [bytes]
// A matrix of this many names takes 50 MB.
constexpr std::size_t kMaxMatrixNames = 20000;

// The part of the limits that is not used up.
struct Budget {
  std::size_t shapes, triangles;
};

// Numbers of shape_msgs/SolidPrimitive.
enum Primitive : std::uint8_t { kBox = 1, kSphere = 2, kCylinder = 3, kCone = 4 };

void read_poses(WireReader* in, const char* what, SceneObject* object,
                std::vector<Eigen::Isometry3d>* X_PS) {
  const std::size_t poses = in->count(kPoseSize, what);
  for (std::size_t i = 0; i < poses; ++i) X_PS->push_back(read_pose(in, what, &object->fault));
}

void take_shape(WireReader* in, Budget* budget) {
  if (budget->shapes == 0) in->fail("it holds more shapes than max_objects");
  --budget->shapes;
}

GeometryElement read_primitive(WireReader* in, std::string* fault) {
  GeometryElement element;
  element.source = "primitive";
  element.shape = Sphere{1.0};  // where there is a fault
  const std::uint8_t type = in->u8("a primitive");
  const std::size_t numbers = in->count(8, "dimensions");
  double size[3] = {};
  for (std::size_t i = 0; i < numbers; ++i) {
    const double value = in->f64("dimensions");
    if (i < 3) size[i] = value;
  }
  if (type < kBox || type > kCone) {
    note(fault, "a primitive is of type " + std::to_string(type) + "; allowed is 1 to 4");
    return element;
  }
  const std::size_t needed = type == kBox ? 3 : (type == kSphere ? 1 : 2);
  if (numbers < needed) {
    note(fault, "a primitive of type " + std::to_string(type) + " has " + std::to_string(numbers) +
                    " dimensions; needed are " + std::to_string(needed));
    return element;
  }
  for (std::size_t i = 0; i < needed; ++i) {
    const std::string bad = size_fault("a dimension", size[i]);
    if (bad.empty()) continue;
    note(fault, bad);
    return element;
  }
  if (type == kBox) element.shape = Box{{size[0], size[1], size[2]}};
  if (type == kSphere) element.shape = Sphere{size[0]};
  if (type == kCylinder) element.shape = Cylinder{size[1], size[0]};  // height first
  if (type == kCone) element.shape = cone(size[1], size[0]);
  return element;
}

GeometryElement read_mesh(WireReader* in, Budget* budget, std::string* fault) {
  TriangleMesh mesh;
  const std::size_t triangles = in->count(kTriangleSize, "triangles");
  if (triangles > budget->triangles) in->fail("it holds more triangles than max_triangles");
  budget->triangles -= triangles;
  mesh.triangles.resize(triangles);
  for (TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (std::uint32_t& corner : triangle) corner = in->u32("triangles");
  }
  const std::size_t vertices = in->count(kPointSize, "vertices");
  // Vertices that no triangle names need not be kept.
  std::uint32_t most = 0;
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    most = std::max(most, *std::max_element(triangle.begin(), triangle.end()));
  }
  if (triangles == 0 || vertices == 0) {
    note(fault, "a mesh has " + std::to_string(vertices) + " vertices and " +
                    std::to_string(triangles) + " triangles");
  } else if (most >= vertices) {
    note(fault, "a mesh has a triangle of vertex " + std::to_string(most) + ", and " +
                    std::to_string(vertices) + " vertices");
  }
  if (!fault->empty()) {
    in->skip(vertices * kPointSize, "vertices");
    mesh = TriangleMesh();
  } else {
    mesh.vertices.resize(vertices);
    for (Eigen::Vector3d& vertex : mesh.vertices) {
      for (int k = 0; k < 3; ++k) vertex[k] = in->f64("vertices");
    }
  }
  GeometryElement element;
  element.source = "mesh";
  element.shape = std::move(mesh);
  return element;
}

GeometryElement read_plane(WireReader* in, std::string* fault) {
  Eigen::Vector3d n;
  for (int k = 0; k < 3; ++k) n[k] = in->f64("a plane");
  const double d = in->f64("a plane");
  const double length = n.norm();
  GeometryElement element;
  if (!(length > 1e-9 && length < 1e9) || !std::isfinite(d)) {
    note(fault, "a plane has no normal: ax + by + cz + d = 0 with (a, b, c) not 0 is needed");
    element.shape = Sphere{1.0};
    return element;
  }
  return half_space(n / length, -d / length);
}

// Poses of shapes may be missing at the end: these are the identity, as in MoveIt.
void read_kind(WireReader* in, const char* what, std::size_t least_size, SceneObject* object,
               Budget* budget,
               const std::function<GeometryElement(WireReader*, std::string*)>& read) {
  const std::size_t shapes = in->count(least_size, what);
  const std::size_t first = object->geometry.size();
  for (std::size_t i = 0; i < shapes; ++i) {
    take_shape(in, budget);
    object->geometry.push_back(read(in, &object->fault));
  }
  std::vector<Eigen::Isometry3d> X_PS;
  read_poses(in, "a shape's pose", object, &X_PS);
  if (shapes > 0 && X_PS.size() > shapes) {
    note(&object->fault, "it has " + std::to_string(shapes) + " " + what + " and " +
                             std::to_string(X_PS.size()) + " poses of them");
    X_PS.resize(shapes);
  }
  if (shapes > 0) X_PS.resize(shapes, Eigen::Isometry3d::Identity());
  for (std::size_t i = 0; i < shapes; ++i) {
    GeometryElement& element = object->geometry[first + i];
    element.X_LE = X_PS[i] * element.X_LE;
  }
  object->X_PS.insert(object->X_PS.end(), X_PS.begin(), X_PS.end());
}

SceneObject read_object(WireReader* in, SceneLayout layout, Budget* budget) {
  SceneObject object;
  object.layout = layout;
  object.frame = read_header_frame(in);
  if (layout == SceneLayout::kObjectPose) {
    object.X_BP = read_pose(in, "its pose", &object.fault);
    object.has_pose = !object.X_BP.matrix().isIdentity(0.0);
  }
  object.id = in->string(kNameBuffer, "an object's name");
  in->skip_string("an object's type");
  in->skip_string("an object's type");
  read_kind(in, "primitives", 5, &object, budget, read_primitive);
  read_kind(in, "meshes", 8, &object, budget, [budget](WireReader* from, std::string* fault) {
    return read_mesh(from, budget, fault);
  });
  read_kind(in, "planes", 32, &object, budget, read_plane);
  if (layout == SceneLayout::kObjectPose) {
    in->skip_strings("subframes");
    in->skip_array(kPoseSize, "subframes");
  }
  const std::uint8_t operation = in->u8("an object's operation");
  if (operation > static_cast<std::uint8_t>(SceneObject::Operation::kMove)) {
    note(&object.fault, "operation is " + std::to_string(operation) + "; allowed is 0 to 3");
  } else {
    object.operation = static_cast<SceneObject::Operation>(operation);
  }
  return object;
}

// Returns whether any joint is stated.
bool skip_joint_states(WireReader* in) {
  in->skip(12, "a header");
  in->skip_string("a header");
  bool has_joints = in->skip_strings("joints") > 0;
  for (int k = 0; k < 3; ++k) in->skip_array(8, "joints");
  in->skip(12, "a header");
  in->skip_string("a header");
  has_joints = in->skip_strings("joints") > 0 || has_joints;
  in->skip_array(56, "transforms of joints");
  in->skip_array(48, "speeds of joints");
  in->skip_array(48, "forces of joints");
  return has_joints;
}

void skip_posture(WireReader* in) {
  in->skip(12, "a header");
  in->skip_string("a header");
  in->skip_strings("joints");
  const std::size_t points = in->count(24, "a posture");
  for (std::size_t i = 0; i < points; ++i) {
    for (int k = 0; k < 4; ++k) in->skip_array(8, "a posture");
    in->skip(8, "a posture");
  }
}

void read_attached(WireReader* in, SceneLayout layout, const WorldLimits& limits, Budget* budget,
                   std::vector<SceneAttachment>* attachments) {
  // The least attached object has 93 bytes, whatever its layout.
  const std::size_t attached = in->count(93, "attached objects");
  if (attached > limits.max_objects) {
    in->fail("it attaches " + std::to_string(attached) + " objects; allowed are " +
             std::to_string(limits.max_objects) + " (max_objects)");
  }
  for (std::size_t i = 0; i < attached; ++i) {
    SceneAttachment attachment;
    attachment.link = in->string(kNameBuffer, "a link's name");
    attachment.object = read_object(in, layout, budget);
    const std::size_t links = in->count(4, "touch_links");
    for (std::size_t k = 0; k < links; ++k) {
      std::string link = in->string(kNameBuffer, "touch_links");
      // A robot has no more links; and of others nothing is measured.
      if (k < kMaxLinks) attachment.touch_links.push_back(std::move(link));
    }
    skip_posture(in);
    in->skip(8, "a weight");
    attachments->push_back(std::move(attachment));
  }
}

void read_matrix(WireReader* in, PlanningScene* scene) {
  const std::size_t names = in->count(4, "names of the allowed collision matrix");
  scene->has_matrix = names > 0;
  std::string fault;
  if (names > kMaxMatrixNames) {
    fault = "it has " + std::to_string(names) + " names, and at most " +
            std::to_string(kMaxMatrixNames) + " are read";
  }
  AllowedCollisions& allowed = scene->allowed;
  for (std::size_t i = 0; i < names; ++i) {
    std::string name = in->string(kNameBuffer, "names of the allowed collision matrix");
    if (fault.empty()) allowed.names.push_back(std::move(name));
  }
  const std::size_t rows = in->count(4, "rows of the allowed collision matrix");
  if (rows != names) note(&fault, "it is not square");
  for (std::size_t i = 0; i < rows; ++i) {
    const std::size_t columns = in->count(1, "a row of the allowed collision matrix");
    if (columns != names) note(&fault, "it is not square");
    std::vector<bool> row(fault.empty() ? columns : 0);
    for (std::size_t k = 0; k < columns; ++k) {
      const bool is_allowed = in->boolean("a row of the allowed collision matrix");
      if (fault.empty()) row[k] = is_allowed;
    }
    if (fault.empty()) allowed.is_allowed.push_back(std::move(row));
  }
  in->skip_strings("default entries");
  in->skip_array(1, "default entries");
  if (fault.empty()) return;
  allowed = AllowedCollisions();
  scene->notes.push_back("the allowed collision matrix is not used: " + fault);
}

void skip_paddings_and_colors(WireReader* in) {
  for (int k = 0; k < 2; ++k) {
    const std::size_t links = in->count(12, "paddings of links");
    for (std::size_t i = 0; i < links; ++i) {
      in->skip_string("paddings of links");
      in->skip(8, "paddings of links");
    }
  }
  const std::size_t colors = in->count(20, "colors");
  for (std::size_t i = 0; i < colors; ++i) {
    in->skip_string("colors");
    in->skip(16, "colors");
  }
}

void read_objects(WireReader* in, SceneLayout layout, const WorldLimits& limits, Budget* budget,
                  std::vector<SceneObject>* objects) {
  const std::size_t count = in->count(53, "objects");
  if (count > limits.max_objects) {
    in->fail("it holds " + std::to_string(count) + " objects; allowed are " +
             std::to_string(limits.max_objects) + " (max_objects)");
  }
  for (std::size_t i = 0; i < count; ++i) objects->push_back(read_object(in, layout, budget));
}

void read_scene(WireReader* in, SceneLayout layout, const WorldLimits& limits,
                const OctreeLimits& octomap_limits, PlanningScene* scene) {
  in->skip_string("the scene's name");
  const bool has_joints = skip_joint_states(in);
  Budget budget{limits.max_objects, limits.max_triangles};
  read_attached(in, layout, limits, &budget, &scene->attachments);
  const bool is_state_diff = in->boolean("the state's is_diff");
  in->skip_string("the robot's name");
  const std::size_t transforms = in->count(76, "fixed transforms");
  for (std::size_t i = 0; i < transforms; ++i) {
    read_header_frame(in);
    in->skip_string("a frame's name");
    in->skip(kPoseSize, "a fixed transform");
  }
  read_matrix(in, scene);
  skip_paddings_and_colors(in);
  read_objects(in, layout, limits, &budget, &scene->objects);
  const bool states_octomap = read_scene_octomap(in, octomap_limits, &scene->octomap);
  scene->is_diff = in->boolean("is_diff");
  scene->sets_octomap = !scene->is_diff || states_octomap || removes_octomap(*scene);
  // A state that says nothing changes nothing, as in MoveIt.
  const bool has_state = has_joints || !scene->attachments.empty();
  scene->keeps_attached = scene->is_diff && (is_state_diff || !has_state);
  if (in->left() > 0) in->fail(std::to_string(in->left()) + " bytes follow its end");
}

}  // namespace

std::optional<SceneLayout> scene_layout(const std::string& md5sum) {
  if (md5sum == "89aac6d20db967ba716cba5a86b1b9d5") return SceneLayout::kShapePoses;
  if (md5sum == "acfc50bcfd6c7b978066bfa7c786002c") return SceneLayout::kObjectPose;
  return std::nullopt;
}

PlanningScene read_planning_scene(Span<const std::uint8_t> bytes, SceneLayout layout,
                                  const WorldLimits& limits, const OctreeLimits& octomap) {
  PlanningScene scene;
  WireReader in(bytes);
  try {
    read_scene(&in, layout, limits, octomap, &scene);
  } catch (const WireError& error) {
    scene = PlanningScene();
    scene.fault = "no planning scene that can be read, " + error.what;
  }
  return scene;
}

}  // namespace ist
