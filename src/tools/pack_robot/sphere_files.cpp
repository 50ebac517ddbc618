#include "sphere_files.h"

#include <tinyxml2.h>

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <set>
#include <sstream>

namespace ist::tools {
namespace {

constexpr int kDigits = 9;  // of a number in metres: less than a nanometre of a robot

std::string quoted(const std::string& name) {
  std::string text = "\"";
  for (const char c : name) {
    if (c == '"' || c == '\\') text += '\\';
    text += c;
  }
  return text + "\"";
}

// A radius is rounded up by more than its centre's digits lose.
double written_radius(const LinkSphere& sphere) { return sphere.radius * (1.0 + 1e-8) + 1e-8; }

std::string text_of(const Eigen::Vector3d& p, const char* between) {
  std::ostringstream text;
  text << std::setprecision(kDigits) << p.x() << between << p.y() << between << p.z();
  return text.str();
}

std::string text_of(double number) {
  std::ostringstream text;
  text << std::setprecision(kDigits) << number;
  return text.str();
}

void add_collision(const LinkSphere& sphere, tinyxml2::XMLElement* link) {
  tinyxml2::XMLElement* collision = link->InsertNewChildElement("collision");
  collision->InsertNewChildElement("origin")->SetAttribute("xyz",
                                                           text_of(sphere.center, " ").c_str());
  collision->InsertNewChildElement("geometry")
      ->InsertNewChildElement("sphere")
      ->SetAttribute("radius", text_of(written_radius(sphere)).c_str());
}

void write_lists(const LinkSpheres& spheres, const std::string& indent, std::ostream* text) {
  for (const auto& [link, of_link] : spheres) {
    *text << indent << quoted(link) << ":\n";
    for (const LinkSphere& sphere : of_link) {
      *text << indent << "  - center: [" << text_of(sphere.center, ", ") << "]\n"
            << indent << "    radius: " << text_of(written_radius(sphere)) << '\n';
    }
  }
}

// The nearest link above that has spheres; empty: there is none.
std::string parent_with_spheres(const RobotDescription& robot, std::string link,
                                const LinkSpheres& spheres) {
  while (true) {
    const auto joint =
        std::find_if(robot.joints.begin(), robot.joints.end(),
                     [&](const JointDescription& j) { return j.child_link == link; });
    if (joint == robot.joints.end()) return "";
    link = joint->parent_link;
    if (spheres.count(link) != 0) return link;
  }
}

bool is_moved(const JointDescription& joint) {
  return joint.type != JointType::kFixed && !joint.mimic.has_value();
}

// [rad, m] The middle of a joint's range, or 0 where it has none or holds 0.
double usual_position(const JointDescription& joint) {
  return joint.lower <= 0.0 && joint.upper >= 0.0 ? 0.0 : 0.5 * (joint.lower + joint.upper);
}

}  // namespace

std::string spheres_as_urdf(const Input& input, const LinkSpheres& spheres) {
  tinyxml2::XMLDocument document;
  if (input.urdf_path.empty()) {
    tinyxml2::XMLElement* robot = document.NewElement("robot");
    robot->SetAttribute("name", input.robot.name.c_str());
    document.InsertEndChild(robot);
    for (const LinkDescription& link : input.robot.links) {
      robot->InsertNewChildElement("link")->SetAttribute("name", link.name.c_str());
    }
  } else {
    document.LoadFile(input.urdf_path.c_str());
  }
  tinyxml2::XMLElement* link = document.RootElement()->FirstChildElement("link");
  for (; link != nullptr; link = link->NextSiblingElement("link")) {
    const char* name = link->Attribute("name");
    const auto found = spheres.find(name != nullptr ? name : "");
    if (found == spheres.end()) continue;
    while (tinyxml2::XMLElement* old = link->FirstChildElement("collision")) {
      link->DeleteChild(old);
    }
    for (const LinkSphere& sphere : found->second) add_collision(sphere, link);
  }
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  return printer.CStr();
}

std::string spheres_as_yaml(const LinkSpheres& spheres) {
  std::ostringstream text;
  text << "# Spheres [m] in each link's own frame. Those of a link contain all of it.\n";
  write_lists(spheres, "", &text);
  return text.str();
}

std::string spheres_as_curobo(const Input& input, const LinkSpheres& spheres) {
  const RobotDescription& robot = input.robot;
  std::map<std::string, std::set<std::string>> ignored;
  std::set<std::string> parents;
  for (const auto& [link, of_link] : spheres) {
    const std::string parent = parent_with_spheres(robot, link, spheres);
    if (!parent.empty()) ignored[parent].insert(link);
  }
  for (const JointDescription& joint : robot.joints) parents.insert(joint.parent_link);
  std::ostringstream names, weights, positions;
  for (const JointDescription& joint : robot.joints) {
    if (!is_moved(joint)) continue;
    const char* between = names.tellp() == std::streampos(0) ? "" : ", ";
    names << between << quoted(joint.name);
    weights << between << 1.0;
    positions << between << text_of(usual_position(joint));
  }
  const std::string folder = std::filesystem::path(input.urdf_path).parent_path().string();
  std::ostringstream text;
  text << "robot_cfg:\n  kinematics:\n    urdf_path: " << quoted(input.urdf_path)
       << "\n    asset_root_path: " << quoted(folder)
       << "\n    base_link: " << quoted(robot.root_link) << "\n    tool_frames:\n";
  for (const std::string& link : robot.link_order) {
    if (parents.count(link) == 0) text << "    - " << quoted(link) << '\n';
  }
  for (const char* key : {"collision_link_names", "mesh_link_names"}) {
    text << "    " << key << ":\n";
    for (const auto& [link, of_link] : spheres) text << "    - " << quoted(link) << '\n';
  }
  text << "    collision_sphere_buffer: 0.0\n    collision_spheres:\n";
  write_lists(spheres, "      ", &text);
  text << "    self_collision_buffer: {}\n    self_collision_ignore:"
       << (ignored.empty() ? " {}\n" : "\n");
  for (const auto& [link, others] : ignored) {
    text << "      " << quoted(link) << ":\n";
    for (const std::string& other : others) text << "      - " << quoted(other) << '\n';
  }
  text << "    cspace:\n      joint_names: [" << names.str() << "]\n      default_joint_position: ["
       << positions.str() << "]\n      null_space_weight: [" << weights.str()
       << "]\n      cspace_distance_weight: [" << weights.str()
       << "]\n      max_acceleration: 15.0\n      max_jerk: 500.0\n";
  return text.str();
}

}  // namespace ist::tools
