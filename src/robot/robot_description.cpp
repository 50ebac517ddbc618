#include "ist_proximity/robot/robot_description.h"

#include <tinyxml2.h>
#include <urdf_model/model.h>

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "internal/geometry/cancelled.h"
#include "internal/geometry/limits.h"
#include "internal/robot/package_resolver.h"
#include "internal/robot/urdfdom_parser.h"
#include "ist_proximity/geometry/error.h"
#include "mesh_reading.h"
#include "urdf_conversion.h"
#include "urdf_document.h"

namespace ist {
namespace {

void copy_attributes(const tinyxml2::XMLElement& from, tinyxml2::XMLElement* to) {
  for (const auto* a = from.FirstAttribute(); a != nullptr; a = a->Next()) {
    to->SetAttribute(a->Name(), a->Value());
  }
}

std::size_t count_elements(const tinyxml2::XMLElement& link, const char* tag) {
  std::size_t count = 0;
  for (const auto* child = link.FirstChildElement(tag); child != nullptr;
       child = child->NextSiblingElement(tag)) {
    ++count;
  }
  return count;
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

RobotDescription parse(const std::string& urdf_xml, GeometrySource source,
                       const PackageFinder& find_package, const ReadingProgress& progress) {
  tinyxml2::XMLDocument document;
  const tinyxml2::XMLElement& robot = robot_element(urdf_xml, &document);
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
