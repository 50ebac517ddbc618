#include <tinyxml2.h>

#include <algorithm>
#include <set>
#include <utility>

#include "internal/geometry/cancelled.h"
#include "ist_proximity/geometry/error.h"
#include "ist_proximity/proximity/collision_rules.h"

namespace ist {
namespace {

const char* const kElements[] = {"group",
                                 "group_state",
                                 "end_effector",
                                 "virtual_joint",
                                 "passive_joint",
                                 "joint_property",
                                 "link_sphere_approximation",
                                 "disable_collisions",
                                 "enable_collisions",
                                 "disable_default_collisions"};

std::string place_of(const tinyxml2::XMLElement& element) {
  return std::string("<") + element.Name() + "> (line " + std::to_string(element.GetLineNum()) +
         ")";
}

std::string link_of(const tinyxml2::XMLElement& element, const char* attribute) {
  const char* name = element.Attribute(attribute);
  if (name != nullptr) return name;
  throw ModelError("the SRDF has a " + place_of(element) + " without " + attribute);
}

// The names that a sentence tells: the first few.
class Named {
 public:
  void add(const std::string& text) {
    constexpr std::size_t kMost = 10;
    if (++count_ <= kMost) text_ += (text_.empty() ? "" : ", ") + text;
    if (count_ > kMost) others_ = " and " + std::to_string(count_ - kMost) + " more";
  }
  bool empty() const { return count_ == 0; }
  std::string text() const { return text_ + others_; }

 private:
  std::size_t count_ = 0;
  std::string text_, others_;
};

CollisionRules read(const std::string& srdf_xml, const Kinematics* kinematics,
                    const CancelRequest& cancelled) {
  CancelWatch watch(cancelled);
  tinyxml2::XMLDocument document;
  if (document.Parse(srdf_xml.c_str(), srdf_xml.size()) != tinyxml2::XML_SUCCESS) {
    throw ModelError(std::string("the SRDF is not well-formed XML: ") + document.ErrorStr());
  }
  const tinyxml2::XMLElement* robot = document.FirstChildElement("robot");
  if (robot == nullptr) throw ModelError("the SRDF has no <robot>");
  CollisionRules rules;
  Named unknown_elements, unknown_links;
  std::set<std::string> told;
  const auto link = [&](const tinyxml2::XMLElement& element, const char* attribute) {
    std::string name = link_of(element, attribute);
    const bool is_unknown = kinematics != nullptr && !kinematics->find_body(name);
    if (is_unknown && told.insert(name).second) {
      unknown_links.add("'" + name + "' in " + place_of(element));
    }
    return name;
  };
  const auto pair = [&](const tinyxml2::XMLElement& element) {
    std::string first = link(element, "link1"), second = link(element, "link2");
    if (second < first) std::swap(first, second);
    return std::make_pair(std::move(first), std::move(second));
  };
  for (const auto* element = robot->FirstChildElement(); element != nullptr;
       element = element->NextSiblingElement()) {
    watch.step();
    const std::string name = element->Name();
    if (name == "disable_collisions") {
      rules.disabled.insert(pair(*element));
    } else if (name == "enable_collisions") {
      rules.enabled.insert(pair(*element));
    } else if (name == "disable_default_collisions") {
      rules.off.insert(link(*element, "link"));
    } else if (std::find(std::begin(kElements), std::end(kElements), name) == std::end(kElements) &&
               told.insert("<" + name).second) {
      unknown_elements.add(place_of(*element));
    }
  }
  if (!unknown_elements.empty()) {
    rules.doubts.push_back("the SRDF has elements that are not known and have no effect: " +
                           unknown_elements.text());
  }
  if (!unknown_links.empty()) {
    rules.doubts.push_back("the SRDF names links that are not in the URDF: " +
                           unknown_links.text());
  }
  return rules;
}

}  // namespace

bool CollisionRules::enables(const std::string& a, const std::string& b) const {
  const std::pair<std::string, std::string> pair = std::minmax(a, b);
  return enabled.count(pair) > 0 && disabled.count(pair) == 0;
}

bool CollisionRules::disables(const std::string& a, const std::string& b) const {
  if (enables(a, b)) return false;
  return off.count(a) > 0 || off.count(b) > 0 || disabled.count(std::minmax(a, b)) > 0;
}

CollisionRules read_srdf(const std::string& srdf_xml, const Kinematics* kinematics,
                         const std::function<bool()>& cancelled) {
  try {
    return read(srdf_xml, kinematics, cancelled);
  } catch (const Cancelled&) {
    throw ModelError("reading of the SRDF was cancelled");
  }
}

}  // namespace ist
