#include "ros/input/world_conversion.h"

#include <string>
#include <vector>

#include "internal/geometry/limits.h"
#include "internal/geometry/mesh_io.h"
#include "internal/robot/package_resolver.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/world_file.h"
#include "ros/common/eigen_conversion.h"
#include "ros/common/frame_name.h"
#include "ros/common/text.h"
#include "ros/input/source.h"

namespace ist {
namespace {

using Message = ist_proximity::WorldObject;

std::vector<double> sizes(const Message& message, std::size_t count, const char* what) {
  if (message.dimensions.size() != count) {
    throw ModelError("dimensions holds " + std::to_string(message.dimensions.size()) +
                     " numbers; needed are " + std::to_string(count) + ": " + what);
  }
  for (const double size : message.dimensions) {
    if (size > 0.0 && size <= kMaxLength) continue;
    throw ModelError(
        format_text("dimensions holds %g m; allowed is more than 0 and at most %g m (%s)", size,
                    kMaxLength, what));
  }
  return message.dimensions;
}

TriangleMesh stated_mesh(const Message& message, const Eigen::Vector3d& scale) {
  const std::string bad_scale = scale_fault(scale);
  if (!bad_scale.empty()) throw ModelError(bad_scale);
  if (message.triangles.empty() || message.triangles.size() % 3 != 0) {
    throw ModelError("mesh is empty and triangles holds " +
                     std::to_string(message.triangles.size()) +
                     " numbers; needed are three for each triangle");
  }
  TriangleMesh mesh;
  for (const auto& vertex : message.vertices) {
    mesh.vertices.emplace_back(scale.cwiseProduct(to_vector(vertex)));
  }
  const bool is_mirrored = scale.prod() < 0.0;
  for (std::size_t i = 0; i < message.triangles.size(); i += 3) {
    TriangleMesh::Triangle triangle{message.triangles[i], message.triangles[i + 1],
                                    message.triangles[i + 2]};
    for (const std::uint32_t corner : triangle) {
      if (corner < mesh.vertices.size()) continue;
      throw ModelError("triangles names vertex " + std::to_string(corner) + " of " +
                       std::to_string(mesh.vertices.size()));
    }
    if (is_mirrored) std::swap(triangle[1], triangle[2]);
    mesh.triangles.push_back(triangle);
  }
  return mesh;
}

Shape mesh_of(const Message& message, const PackageFinder& find_package,
              const CancelRequest& cancelled) {
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();
  if (!message.dimensions.empty()) {
    if (message.dimensions.size() != 3) throw ModelError("dimensions: 3 scales are needed");
    scale << message.dimensions[0], message.dimensions[1], message.dimensions[2];
  }
  if (message.mesh.empty()) return stated_mesh(message, scale);
  return load_mesh(resolve_uri(message.mesh, find_package), scale, cancelled);
}

}  // namespace

GeometryElement to_element(const Message& message, const PackageFinder& find_package,
                           const CancelRequest& cancelled) {
  GeometryElement element;
  switch (message.shape) {
    case Message::BOX: {
      const std::vector<double> size = sizes(message, 3, "size along x, y, z");
      element.shape = Box{{size[0], size[1], size[2]}};
      break;
    }
    case Message::CYLINDER:
    case Message::CONE: {
      const std::vector<double> size = sizes(message, 2, "radius, length");
      if (message.shape == Message::CONE) {
        element.shape = cone(size[0], size[1]);
      } else {
        element.shape = Cylinder{size[0], size[1]};
      }
      break;
    }
    case Message::SPHERE:
      element.shape = Sphere{sizes(message, 1, "radius")[0]};
      break;
    case Message::PLANE:
      element = half_space(Eigen::Vector3d::UnitZ(), 0.0);
      break;
    case Message::MESH:
      element.shape = mesh_of(message, find_package, cancelled);
      break;
    default:
      throw ModelError("shape is " + std::to_string(message.shape) + "; allowed is 0 to 5");
  }
  element.source = message.mesh.empty() ? "its shape" : printable(message.mesh);
  return element;
}

std::string object_frame(const std::string& stated, const std::string& other) {
  if (stated.empty()) return other;
  const std::string name = without_slash(stated);
  if (name.empty() || name == kFixedFrame) {
    throw ModelError("header.frame_id is '" + stated + "', which is no frame of tf");
  }
  return stated;
}

Eigen::Isometry3d to_object_pose(const geometry_msgs::Pose& pose) {
  geometry_msgs::Transform transform;
  assign(to_vector(pose.position), &transform.translation);
  transform.rotation = pose.orientation;
  Eigen::Isometry3d X;
  const std::string fault = to_isometry(transform, &X);
  if (!fault.empty()) throw ModelError("pose: " + fault);
  return X;
}

WorldObject to_world_object(const Message& message, const WorldConfig& config,
                            const CancelRequest& cancelled) {
  WorldObject object;
  object.name = message.id;
  object.frame = object_frame(message.header.frame_id, config.frame_id);
  object.X_BO = to_object_pose(message.pose);
  object.geometry = {to_element(message, environment_package_finder(), cancelled)};
  if (!(message.margin >= 0.0)) {
    throw ModelError("margin is " + std::to_string(message.margin) + " m; it must be 0 or more");
  }
  object.margin = message.margin + config.margin;
  object.allowed_links = message.allowed_links;
  return object;
}

}  // namespace ist
