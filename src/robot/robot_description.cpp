#include "ist_proximity/robot/robot_description.h"

#include <tinyxml2.h>
#include <urdf_model/model.h>

#include <cmath>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "internal/geometry/mesh_io.h"
#include "internal/robot/package_resolver.h"
#include "internal/robot/urdfdom_parser.h"
#include "ist_proximity/geometry/error.h"

namespace ist {
namespace {

const tinyxml2::XMLElement& robot_element(const std::string& urdf_xml,
                                          tinyxml2::XMLDocument* document) {
  if (urdf_xml.find_first_not_of(" \t\r\n") == std::string::npos) {
    throw ModelError("robot description is empty; load a URDF into it");
  }
  if (document->Parse(urdf_xml.c_str(), urdf_xml.size()) != tinyxml2::XML_SUCCESS) {
    throw ModelError(std::string("robot description is not well-formed XML: ") +
                     document->ErrorStr());
  }
  const tinyxml2::XMLElement* root = document->RootElement();
  if (root == nullptr) throw ModelError("robot description is no URDF: it holds no element");
  if (root->Name() != std::string("robot")) {
    throw ModelError(std::string("robot description is no URDF: its root element is <") +
                     root->Name() + ">, not <robot>");
  }
  for (const auto* child = root->FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (std::string(child->Name()).compare(0, 6, "xacro:") == 0) {
      throw ModelError(std::string("robot description holds <") + child->Name() +
                       ">; it must be processed by xacro first");
    }
  }
  return *root;
}

void copy_attributes(const tinyxml2::XMLElement& from, tinyxml2::XMLElement* to) {
  for (const auto* a = from.FirstAttribute(); a != nullptr; a = a->Next()) {
    to->SetAttribute(a->Name(), a->Value());
  }
}

std::string link_attribute(const tinyxml2::XMLElement& joint, const char* tag) {
  const tinyxml2::XMLElement* end = joint.FirstChildElement(tag);
  const char* link = end != nullptr ? end->Attribute("link") : nullptr;
  return link != nullptr ? link : "";
}

// urdfdom accepts a link with two parents, and rings of joints beside the root's tree (which it
// never frees). It reports all other faults of joints itself.
void check_tree(const tinyxml2::XMLElement& robot) {
  std::map<std::string, const tinyxml2::XMLElement*> joint_above;
  const auto name = [](const tinyxml2::XMLElement* joint) {
    const char* text = joint->Attribute("name");
    return std::string(text != nullptr ? text : "");
  };
  for (const auto* joint = robot.FirstChildElement("joint"); joint != nullptr;
       joint = joint->NextSiblingElement("joint")) {
    const std::string child = link_attribute(*joint, "child");
    if (child.empty()) continue;
    const auto [other, is_new] = joint_above.insert({child, joint});
    if (is_new) continue;
    throw ModelError("robot description is no tree: link '" + child + "' is the child of joint '" +
                     name(other->second) + "' and of joint '" + name(joint) +
                     "'; a link may have one parent");
  }
  for (const auto& [link, joint] : joint_above) {
    std::string above = link_attribute(*joint, "parent");
    for (std::size_t steps = 0; joint_above.count(above) > 0; ++steps) {
      if (above == link || steps > joint_above.size()) {
        throw ModelError("robot description is no tree: the joints above link '" + link +
                         "' form a ring");
      }
      above = link_attribute(*joint_above.at(above), "parent");
    }
  }
}

// Parses links and joints alone: the content of a link is parsed element by element, so that one
// faulty element does not cost the others.
urdf::ModelInterfaceSharedPtr parse_structure(const tinyxml2::XMLElement& robot) {
  tinyxml2::XMLDocument skeleton;
  tinyxml2::XMLElement* root = skeleton.NewElement("robot");
  skeleton.InsertEndChild(root);
  copy_attributes(robot, root);
  for (const auto* child = robot.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (child->Name() == std::string("link")) {
      const char* name = child->Attribute("name");
      if (name == nullptr || *name == '\0') {
        throw ModelError("robot description has a <link> without a name (line " +
                         std::to_string(child->GetLineNum()) + ")");
      }
      tinyxml2::XMLElement* link = skeleton.NewElement("link");
      root->InsertEndChild(link);
      copy_attributes(*child, link);
    } else if (child->Name() == std::string("joint")) {
      root->InsertEndChild(child->DeepClone(&skeleton));
    }
  }
  const ParsedUrdf parsed = parse_with_urdfdom(skeleton);
  if (parsed.model != nullptr) return parsed.model;
  std::string reasons;
  for (const std::string& error : parsed.errors) reasons += (reasons.empty() ? "" : ": ") + error;
  throw ModelError("robot description is no valid URDF: " + reasons);
}

void check_size(const char* what, double value) {
  if (std::isfinite(value) && value > 0.0) return;
  std::ostringstream text;
  text << "its " << what << " is " << value << " m; it must be > 0";
  throw ModelError(text.str());
}

Shape to_shape(const urdf::Geometry& geometry, const PackageFinder& find_package) {
  switch (geometry.type) {
    case urdf::Geometry::BOX: {
      const urdf::Vector3& size = static_cast<const urdf::Box&>(geometry).dim;
      check_size("size along x", size.x);
      check_size("size along y", size.y);
      check_size("size along z", size.z);
      return Box{{size.x, size.y, size.z}};
    }
    case urdf::Geometry::CYLINDER: {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
      check_size("radius", cylinder.radius);
      check_size("length", cylinder.length);
      return Cylinder{cylinder.radius, cylinder.length};
    }
    case urdf::Geometry::SPHERE: {
      const double radius = static_cast<const urdf::Sphere&>(geometry).radius;
      check_size("radius", radius);
      return Sphere{radius};
    }
    case urdf::Geometry::MESH: {
      const auto& mesh = static_cast<const urdf::Mesh&>(geometry);
      return load_mesh(resolve_uri(mesh.filename, find_package),
                       {mesh.scale.x, mesh.scale.y, mesh.scale.z});
    }
    default:  // newer versions of urdfdom know more shapes
      throw ModelError("its shape is not supported; use box, cylinder, sphere or mesh");
  }
}

Eigen::Isometry3d to_isometry(const urdf::Pose& pose) {
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.translation() << pose.position.x, pose.position.y, pose.position.z;
  const urdf::Rotation& q = pose.rotation;
  X.linear() = Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized().toRotationMatrix();
  return X;
}

JointType to_joint_type(int type) {
  switch (type) {
    case urdf::Joint::REVOLUTE:
      return JointType::kRevolute;
    case urdf::Joint::CONTINUOUS:
      return JointType::kContinuous;
    case urdf::Joint::PRISMATIC:
      return JointType::kPrismatic;
    case urdf::Joint::PLANAR:
      return JointType::kPlanar;
    case urdf::Joint::FLOATING:
      return JointType::kFloating;
    default:
      return JointType::kFixed;
  }
}

// Numbers are not checked here: whoever needs the joint's motion checks them.
JointDescription to_joint(const urdf::Joint& joint) {
  JointDescription result;
  result.name = joint.name;
  result.type = to_joint_type(joint.type);
  result.parent_link = joint.parent_link_name;
  result.child_link = joint.child_link_name;
  result.X_PJ = to_isometry(joint.parent_to_joint_origin_transform);
  result.axis << joint.axis.x, joint.axis.y, joint.axis.z;
  if (joint.limits &&
      (joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::PRISMATIC)) {
    result.lower = joint.limits->lower;
    result.upper = joint.limits->upper;
  }
  if (joint.mimic) {
    result.mimic = Mimic{joint.mimic->joint_name, joint.mimic->multiplier, joint.mimic->offset};
  }
  return result;
}

// Lets urdfdom parse a <collision> or <visual>, alone in a robot of one link.
GeometryElement parse_element(const tinyxml2::XMLElement& xml, const PackageFinder& find_package) {
  tinyxml2::XMLDocument document;
  document.Parse("<robot name='r'><link name='l'/></robot>");
  tinyxml2::XMLNode* copy = xml.DeepClone(&document);
  while (auto* material = copy->FirstChildElement("material")) copy->DeleteChild(material);
  document.RootElement()->FirstChildElement("link")->InsertEndChild(copy);
  if (copy->FirstChildElement("geometry") == nullptr) {
    throw ModelError("it has no <geometry>; add one or remove the element");
  }

  const ParsedUrdf parsed = parse_with_urdfdom(document);
  const urdf::LinkConstSharedPtr link = parsed.model ? parsed.model->getLink("l") : nullptr;
  if (link == nullptr || !parsed.errors.empty()) {
    throw ModelError(parsed.errors.front() + "; correct the element in the URDF");
  }
  urdf::GeometrySharedPtr geometry;
  urdf::Pose origin;
  if (!link->collision_array.empty()) {
    geometry = link->collision_array.front()->geometry;
    origin = link->collision_array.front()->origin;
  } else if (!link->visual_array.empty()) {
    geometry = link->visual_array.front()->geometry;
    origin = link->visual_array.front()->origin;
  }
  if (geometry == nullptr) throw ModelError("its <geometry> cannot be read");

  GeometryElement element;
  element.X_LE = to_isometry(origin);
  if (!element.X_LE.matrix().allFinite()) throw ModelError("its <origin> is not finite");
  element.shape = to_shape(*geometry, find_package);
  return element;
}

// The element's shape for messages: a mesh's URI, or the name of the shape.
std::string source_name(const tinyxml2::XMLElement& xml) {
  const auto* geometry = xml.FirstChildElement("geometry");
  const auto* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
  if (shape == nullptr) return "no shape";
  const char* file = shape->Attribute("filename");
  return file != nullptr && *file != '\0' ? file : shape->Name();
}

void parse_geometry(const tinyxml2::XMLElement& link_xml, const char* tag,
                    const PackageFinder& find_package, LinkDescription* link) {
  int number = 0;
  for (const auto* xml = link_xml.FirstChildElement(tag); xml != nullptr;
       xml = xml->NextSiblingElement(tag)) {
    ++number;
    const std::string source = source_name(*xml);
    try {
      link->geometry.push_back(parse_element(*xml, find_package));
      link->geometry.back().source = source;
    } catch (const ModelError& error) {
      link->error += link->error.empty() ? "link '" + link->name + "', " : "; and ";
      link->error += std::string(tag) + " element " + std::to_string(number) + " (" + source +
                     "): " + error.what();
    }
  }
  if (!link->error.empty()) link->geometry.clear();  // part of a link would be an unsafe link
}

}  // namespace

RobotDescription parse_urdf(const std::string& urdf_xml, GeometrySource source,
                            const PackageFinder& find_package) {
  tinyxml2::XMLDocument document;
  const tinyxml2::XMLElement& robot = robot_element(urdf_xml, &document);
  check_tree(robot);
  const urdf::ModelInterfaceSharedPtr model = parse_structure(robot);

  RobotDescription description;
  description.name = model->getName();
  description.root_link = model->getRoot()->name;
  for (const auto& [name, joint] : model->joints_) description.joints.push_back(to_joint(*joint));
  for (const auto* xml = robot.FirstChildElement("link"); xml != nullptr;
       xml = xml->NextSiblingElement("link")) {
    LinkDescription link;
    link.name = xml->Attribute("name");
    description.link_order.push_back(link.name);
    const bool has_collision = xml->FirstChildElement("collision") != nullptr;
    const bool has_visual = xml->FirstChildElement("visual") != nullptr;
    link.used_visual_fallback =
        source == GeometrySource::kCollision && !has_collision && has_visual;
    const bool use_visual = source == GeometrySource::kVisual || link.used_visual_fallback;
    if (use_visual ? !has_visual : !has_collision) {
      description.links_without_geometry.push_back(link.name);
      continue;
    }
    parse_geometry(*xml, use_visual ? "visual" : "collision", find_package, &link);
    description.links.push_back(std::move(link));
  }
  return description;
}

}  // namespace ist
