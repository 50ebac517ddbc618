#include "ist_proximity/robot/robot_description.h"

#include <tinyxml2.h>
#include <urdf_model/model.h>

#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/limits.h"
#include "internal/robot/package_resolver.h"
#include "internal/robot/urdfdom_parser.h"
#include "ist_proximity/geometry/error.h"
#include "mesh_reading.h"

namespace ist {
namespace {

// The name of the first element that xacro would replace; null: there is none. xacro's elements
// stand anywhere, and urdfdom leaves out what it does not know: a link would lose its geometry.
const char* find_xacro(const tinyxml2::XMLElement& root) {
  for (const tinyxml2::XMLElement* at = &root; at != nullptr;) {
    if (std::string(at->Name()).compare(0, 6, "xacro:") == 0) return at->Name();
    const tinyxml2::XMLElement* next = at->FirstChildElement();
    while (next == nullptr && at != &root) {
      next = at->NextSiblingElement();
      if (next == nullptr) at = at->Parent()->ToElement();
    }
    at = next;
  }
  return nullptr;
}

const tinyxml2::XMLElement& robot_element(const std::string& urdf_xml,
                                          tinyxml2::XMLDocument* document) {
  if (urdf_xml.find_first_not_of(" \t\r\n") == std::string::npos) {
    throw ModelError("robot description is empty; load a URDF into it");
  }
  if (urdf_xml.size() > kMaxDescriptionSize) {
    throw ModelError("robot description has " + std::to_string(urdf_xml.size()) +
                     " bytes; allowed are at most " + std::to_string(kMaxDescriptionSize));
  }
  const std::size_t first = urdf_xml.find_first_not_of(" \t\r\n\xEF\xBB\xBF");
  if (first != std::string::npos && urdf_xml[first] != '<') {
    throw ModelError("robot description is not well-formed XML: it begins with '" +
                     printable(urdf_xml.substr(first, 60)) +
                     "'; it must hold the URDF itself, not a file's name: in a launch file <param "
                     "name=\"robot_description\" textfile=\"FILE\"/>, or command=\"xacro FILE\"");
  }
  if (document->Parse(urdf_xml.c_str(), urdf_xml.size()) != tinyxml2::XML_SUCCESS) {
    throw ModelError(std::string("robot description is not well-formed XML: ") +
                     printable(document->ErrorStr()));
  }
  const tinyxml2::XMLElement* root = document->RootElement();
  if (root == nullptr) throw ModelError("robot description is no URDF: it holds no element");
  if (root->Name() != std::string("robot")) {
    throw ModelError(std::string("robot description is no URDF: its root element is <") +
                     printable(root->Name()) + ">, not <robot>");
  }
  if (const char* element = find_xacro(*root)) {
    throw ModelError("robot description holds <" + printable(element) +
                     ">; it must be processed by xacro first: `xacro FILE > robot.urdf`, or in a "
                     "launch file <param name=\"robot_description\" command=\"xacro FILE\"/>");
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
  // Every walk upwards ends at a link that an earlier walk has passed, so each joint is met once.
  std::set<std::string> reaches_root;
  for (const auto& [link, joint] : joint_above) {
    std::set<std::string> walk;
    std::string at = link;
    while (joint_above.count(at) > 0 && reaches_root.count(at) == 0) {
      if (!walk.insert(at).second) {
        throw ModelError("robot description is no tree: the joints above link '" + at +
                         "' form a ring");
      }
      at = link_attribute(*joint_above.at(at), "parent");
    }
    reaches_root.merge(walk);
  }
}

// Names go into messages, topics and logs.
void check_name(const tinyxml2::XMLElement& element) {
  const char* text = element.Attribute("name");
  if (text == nullptr || *text == '\0') {
    if (element.Name() != std::string("link")) return;  // urdfdom reports the others
    throw ModelError("robot description has a <link> without a name (line " +
                     std::to_string(element.GetLineNum()) + ")");
  }
  const std::string fault = name_fault(text);
  if (fault.empty()) return;
  throw ModelError("robot description: the name of a <" + std::string(element.Name()) + "> (line " +
                   std::to_string(element.GetLineNum()) + ") " + fault);
}

std::size_t count_children(const tinyxml2::XMLElement& robot, const char* tag) {
  std::size_t count = 0;
  for (const auto* child = robot.FirstChildElement(tag); child != nullptr;
       child = child->NextSiblingElement(tag)) {
    check_name(*child);
    ++count;
  }
  return count;
}

std::size_t count_elements(const tinyxml2::XMLElement& link, const char* tag) {
  std::size_t count = 0;
  for (const auto* child = link.FirstChildElement(tag); child != nullptr;
       child = child->NextSiblingElement(tag)) {
    ++count;
  }
  return count;
}

void check_names_and_counts(const tinyxml2::XMLElement& robot) {
  check_name(robot);
  for (const char* tag : {"link", "joint"}) {
    const std::size_t count = count_children(robot, tag);
    if (count > kMaxLinks) {
      throw ModelError("robot description has " + std::to_string(count) + " " + tag +
                       "s; allowed are at most " + std::to_string(kMaxLinks));
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

// An element of a link while the meshes are not read yet.
struct UnreadElement {
  GeometryElement element;          // without its mesh
  std::optional<std::size_t> mesh;  // in the MeshReading
  std::string error;                // why there is no element
};

struct UnreadLink {
  LinkDescription link;  // without geometry
  const char* tag;       // of its elements
  std::vector<UnreadElement> elements;
};

// Elements need these to name their meshes.
struct MeshNames {
  const PackageFinder& find_package;
  MeshReading& reading;
};

Shape to_shape(const urdf::Geometry& geometry) {
  switch (geometry.type) {
    case urdf::Geometry::BOX: {
      const urdf::Vector3& size = static_cast<const urdf::Box&>(geometry).dim;
      return Box{{size.x, size.y, size.z}};
    }
    case urdf::Geometry::CYLINDER: {
      const auto& cylinder = static_cast<const urdf::Cylinder&>(geometry);
      return Cylinder{cylinder.radius, cylinder.length};
    }
    case urdf::Geometry::SPHERE: {
      return Sphere{static_cast<const urdf::Sphere&>(geometry).radius};
    }
    case urdf::Geometry::MESH:
      return TriangleMesh{};
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
    // Limits farther out than any position counts are none.
    if (std::abs(joint.limits->lower) <= kMaxLength) result.lower = joint.limits->lower;
    if (std::abs(joint.limits->upper) <= kMaxLength) result.upper = joint.limits->upper;
  }
  if (joint.mimic) {
    result.mimic = Mimic{joint.mimic->joint_name, joint.mimic->multiplier, joint.mimic->offset};
  }
  return result;
}

void check_shape(const Shape& shape) {
  const std::string fault = shape_fault(shape);
  if (!fault.empty()) throw ModelError(fault);
}

// Lets urdfdom parse a <collision> or <visual>, alone in a robot of one link.
UnreadElement parse_element(const tinyxml2::XMLElement& xml, const std::string& link_name,
                            const MeshNames& names) {
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

  UnreadElement unread;
  GeometryElement& element = unread.element;
  element.X_LE = to_isometry(origin);
  if (!element.X_LE.matrix().allFinite()) throw ModelError("its <origin> is not finite");
  const std::string misplaced = position_fault("its <origin>", element.X_LE.translation());
  if (!misplaced.empty()) throw ModelError(misplaced);
  element.shape = to_shape(*geometry);
  if (geometry->type == urdf::Geometry::MESH) {
    const auto& mesh = static_cast<const urdf::Mesh&>(*geometry);
    unread.mesh =
        names.reading.add(link_name, mesh.filename, resolve_uri(mesh.filename, names.find_package),
                          {mesh.scale.x, mesh.scale.y, mesh.scale.z});
  } else {
    check_shape(element.shape);
  }
  return unread;
}

// The element's shape for messages: a mesh's URI, or the name of the shape.
std::string source_name(const tinyxml2::XMLElement& xml) {
  const auto* geometry = xml.FirstChildElement("geometry");
  const auto* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
  if (shape == nullptr) return "no shape";
  const char* file = shape->Attribute("filename");
  return printable(file != nullptr && *file != '\0' ? file : shape->Name());
}

void parse_elements(const tinyxml2::XMLElement& link_xml, const MeshNames& names,
                    UnreadLink* link) {
  for (const auto* xml = link_xml.FirstChildElement(link->tag); xml != nullptr;
       xml = xml->NextSiblingElement(link->tag)) {
    UnreadElement unread;
    try {
      unread = parse_element(*xml, link->link.name, names);
    } catch (const ModelError& error) {
      unread.error = error.what();
    }
    unread.element.source = source_name(*xml);
    link->elements.push_back(std::move(unread));
  }
}

GeometryElement read_element(UnreadElement* unread, MeshReading* meshes) {
  if (!unread->error.empty()) throw ModelError(unread->error);
  if (unread->mesh) {
    unread->element.shape = meshes->take(*unread->mesh);
    check_shape(unread->element.shape);
  }
  return std::move(unread->element);
}

LinkDescription read_link(UnreadLink* unread, MeshReading* meshes) {
  constexpr std::size_t kMaxErrorSize = 2000;  // a message is meant to be read
  LinkDescription& link = unread->link;
  for (std::size_t e = 0; e < unread->elements.size(); ++e) {
    const std::string source = unread->elements[e].element.source;
    try {
      link.geometry.push_back(read_element(&unread->elements[e], meshes));
    } catch (const ModelError& error) {
      if (link.error.size() > kMaxErrorSize) continue;
      link.error += link.error.empty() ? "link '" + link.name + "', " : "; and ";
      link.error += std::string(unread->tag) + " element " + std::to_string(e + 1) + " (" + source +
                    "): " + error.what();
    }
  }
  if (!link.error.empty()) link.geometry.clear();  // part of a link would be an unsafe link
  return std::move(link);
}

}  // namespace

namespace {

RobotDescription parse(const std::string& urdf_xml, GeometrySource source,
                       const PackageFinder& find_package, const ReadingProgress& progress) {
  tinyxml2::XMLDocument document;
  const tinyxml2::XMLElement& robot = robot_element(urdf_xml, &document);
  check_names_and_counts(robot);
  check_tree(robot);
  const urdf::ModelInterfaceSharedPtr model = parse_structure(robot);

  RobotDescription description;
  description.name = model->getName();
  description.root_link = model->getRoot()->name;
  for (const auto& [name, joint] : model->joints_) description.joints.push_back(to_joint(*joint));
  MeshReading meshes;
  std::vector<UnreadLink> links;
  std::size_t elements = 0;
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
    const char* tag = use_visual ? "visual" : "collision";
    elements += count_elements(*xml, tag);
    if (elements > kMaxElements) {
      throw ModelError("robot description has more than " + std::to_string(kMaxElements) +
                       " elements with geometry; the limit is reached at link '" + link.name + "'");
    }
    links.push_back({std::move(link), tag, {}});
    parse_elements(*xml, {find_package, meshes}, &links.back());
  }
  meshes.read(progress);
  for (UnreadLink& link : links) description.links.push_back(read_link(&link, &meshes));
  return description;
}

}  // namespace

RobotDescription parse_urdf(const std::string& urdf_xml, GeometrySource source,
                            const PackageFinder& find_package, const ReadingProgress& progress) {
  try {
    return parse(urdf_xml, source, find_package, progress);
  } catch (const Cancelled&) {
    throw ModelError("reading of the robot description was cancelled");
  }
}

}  // namespace ist
