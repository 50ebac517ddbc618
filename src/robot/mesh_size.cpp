#include "internal/robot/mesh_size.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <variant>

namespace ist {
namespace {

// [m] No link of a robot is larger, or smaller.
constexpr double kLarge = 10.0, kSmall = 0.001;

Eigen::Vector3d size_of(const TriangleMesh& mesh) {
  Eigen::AlignedBox3d box;
  for (const TriangleMesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) box.extend(mesh.vertices[vertex]);
  }
  return box.sizes();
}

std::string doubt(const std::string& link, const GeometryElement& element) {
  const auto* mesh = std::get_if<TriangleMesh>(&element.shape);
  if (mesh == nullptr || mesh->triangles.empty()) return "";
  const Eigen::Vector3d size = size_of(*mesh);
  const bool is_large = size.maxCoeff() > kLarge;
  if (!is_large && size.maxCoeff() >= kSmall) return "";
  char text[96];
  std::snprintf(text, sizeof text, ") measures %.3g x %.3g x %.3g m: ", size.x(), size.y(),
                size.z());
  return "link '" + link + "': its mesh (" + element.source + text +
         (is_large ? "is it in millimetres? Then it wants scale=\"0.001 0.001 0.001\" in the URDF"
                   : "is it in metres already, or scaled twice? See its scale in the URDF");
}

}  // namespace

std::vector<std::string> doubtful_sizes(const RobotDescription& robot,
                                        const std::vector<std::string>& links) {
  std::vector<std::string> doubts;
  for (const LinkDescription& link : robot.links) {
    const bool is_wanted =
        links.empty() || std::find(links.begin(), links.end(), link.name) != links.end();
    for (const GeometryElement& element : link.geometry) {
      const std::string text = is_wanted ? doubt(link.name, element) : "";
      if (!text.empty()) doubts.push_back(text);
    }
  }
  return doubts;
}

std::string doubtful_limits(const RobotDescription& robot) {
  std::string names;
  for (const JointDescription& joint : robot.joints) {
    const bool wants_limits =
        joint.type == JointType::kRevolute || joint.type == JointType::kPrismatic;
    const bool has_limits = std::isfinite(joint.lower) || std::isfinite(joint.upper);
    if (!wants_limits || has_limits || joint.mimic) continue;
    names += (names.empty() ? "'" : ", '") + joint.name + "'";
  }
  if (names.empty()) return "";
  return "joints that state no limits, a lower one below an upper one, and are taken to have "
         "none: " +
         names;
}

}  // namespace ist
