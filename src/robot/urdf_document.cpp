#include "urdf_document.h"

#include <map>
#include <set>

#include "internal/geometry/limits.h"
#include "ist_proximity/geometry/error.h"

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

const tinyxml2::XMLElement& parsed_root(const std::string& urdf_xml,
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

}  // namespace

const tinyxml2::XMLElement& robot_element(const std::string& urdf_xml,
                                          tinyxml2::XMLDocument* document) {
  const tinyxml2::XMLElement& robot = parsed_root(urdf_xml, document);
  check_names_and_counts(robot);
  check_tree(robot);
  return robot;
}

}  // namespace ist
