#include "input.h"

#include <tinyxml2.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "internal/geometry/mesh_io.h"
#include "internal/robot/package_resolver.h"
#include "internal/robot/urdfdom_parser.h"
#include "ist_proximity/geometry/error.h"

namespace ist::tools {
namespace {

std::string read_text(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  if (!file) throw ModelError("cannot read '" + path + "'");
  return text.str();
}

Eigen::Isometry3d pose(const urdf::Pose& origin) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() = Eigen::Vector3d(origin.position.x, origin.position.y, origin.position.z);
  const urdf::Rotation& q = origin.rotation;
  X.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  return X;
}

void place(const urdf::Link& link, const Eigen::Isometry3d& X_RL, Input* input) {
  input->X_RL[link.name] = X_RL;
  for (const auto& child : link.child_links) {
    const Eigen::Isometry3d X_LC = pose(child->parent_joint->parent_to_joint_origin_transform);
    place(*child, X_RL * X_LC, input);
  }
}

Input read_urdf(const std::string& path, GeometrySource source,
                const std::vector<std::string>& package_dirs) {
  const std::string text = read_text(path);
  Input input;
  input.urdf_path = path;
  input.robot = parse_urdf(text, source, file_package_finder(path, package_dirs));
  tinyxml2::XMLDocument document;
  document.Parse(text.c_str());
  const ParsedUrdf parsed = parse_with_urdfdom(document);
  if (parsed.model != nullptr && parsed.model->getRoot() != nullptr) {
    place(*parsed.model->getRoot(), Eigen::Isometry3d::Identity(), &input);
  }
  return input;
}

}  // namespace

Input read_input(const std::string& uri, GeometrySource source,
                 const std::vector<std::string>& package_dirs) {
  namespace fs = std::filesystem;
  const bool is_uri = uri.find("://") != std::string::npos;
  const std::string path =
      is_uri ? resolve_uri(uri, file_package_finder("", package_dirs)) : fs::absolute(uri).string();
  if (!fs::is_regular_file(path)) throw ModelError("there is no file '" + path + "'");
  const std::string extension = fs::path(path).extension();
  if (extension == ".xacro") {
    throw ModelError("'" + path + "' is a xacro file; expand it first: xacro '" + path +
                     "' > robot.urdf, then pack robot.urdf");
  }
  if (extension == ".urdf" || extension == ".xml") return read_urdf(path, source, package_dirs);
  Input input;
  LinkDescription link;
  link.name = fs::path(path).stem();
  link.geometry.push_back({load_mesh(path), Eigen::Isometry3d::Identity(), path});
  input.robot.name = input.robot.root_link = link.name;
  input.robot.links.push_back(std::move(link));
  return input;
}

}  // namespace ist::tools
