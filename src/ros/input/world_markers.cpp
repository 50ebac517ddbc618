#include "ros/input/world_markers.h"

#include <Eigen/Geometry>
#include <cstddef>
#include <variant>

#include "ros/common/eigen_conversion.h"

namespace ist {
namespace {

using visualization_msgs::Marker;

constexpr std::size_t kMaxTriangles = 20000;

void set_pose(const Eigen::Isometry3d& X, Marker* marker) {
  assign(X.translation(), &marker->pose.position);
  marker->pose.orientation = to_message(X).rotation;
}

void draw_box(const Eigen::AlignedBox3d& box, Marker* marker) {
  marker->type = Marker::CUBE;
  assign(box.sizes(), &marker->scale);
}

void draw_mesh(const TriangleMesh& mesh, const Eigen::Isometry3d& X, Marker* marker) {
  if (mesh.triangles.size() > kMaxTriangles) {
    Eigen::AlignedBox3d box;
    for (const auto& triangle : mesh.triangles) {
      for (const std::uint32_t corner : triangle) box.extend(mesh.vertices[corner]);
    }
    draw_box(box, marker);
    return set_pose(X * Eigen::Translation3d(box.center()), marker);
  }
  marker->type = Marker::TRIANGLE_LIST;
  marker->scale.x = marker->scale.y = marker->scale.z = 1.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      marker->points.emplace_back();
      assign(mesh.corner(t, k), &marker->points.back());
    }
  }
}

}  // namespace

void draw_shape(const Shape& shape, const Eigen::Isometry3d& X, Marker* marker) {
  set_pose(X, marker);
  if (const auto* box = std::get_if<Box>(&shape)) {
    marker->type = Marker::CUBE;
    assign(box->size, &marker->scale);
  } else if (const auto* sphere = std::get_if<Sphere>(&shape)) {
    marker->type = Marker::SPHERE;
    marker->scale.x = marker->scale.y = marker->scale.z = 2.0 * sphere->radius;
  } else if (const auto* cylinder = std::get_if<Cylinder>(&shape)) {
    marker->type = Marker::CYLINDER;
    marker->scale.x = marker->scale.y = 2.0 * cylinder->radius;
    marker->scale.z = cylinder->length;
  } else {
    draw_mesh(std::get<TriangleMesh>(shape), X, marker);
  }
}

visualization_msgs::MarkerArray world_markers(
    const KnownWorld& world, const std::function<std::string(const std::string&)>& frame_of) {
  visualization_msgs::MarkerArray array;
  array.markers.emplace_back();
  array.markers.back().action = Marker::DELETEALL;
  array.markers.back().pose.orientation.w = 1.0;
  for (const KnownWorld::Object& object : world.objects()) {
    const std::string frame = frame_of(world.frames()[object.frame]);
    if (frame.empty()) continue;
    int id = 0;
    for (const GeometryElement& element : *object.geometry) {
      Marker marker;
      marker.header.frame_id = frame;
      marker.ns = object.name;
      marker.id = id++;
      marker.frame_locked = 1;
      marker.color.r = marker.color.g = 0.6F;
      marker.color.b = 0.65F;
      marker.color.a = 0.5F;
      draw_shape(element.shape, object.X_BO * element.X_LE, &marker);
      array.markers.push_back(std::move(marker));
    }
  }
  return array;
}

}  // namespace ist
