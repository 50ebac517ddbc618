#include "geometry/collada_check.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ist {
namespace {

using tinyxml2::XMLElement;

// The name without the prefix of its namespace.
const char* local_name(const XMLElement& element) {
  const char* colon = std::strchr(element.Name(), ':');
  return colon != nullptr ? colon + 1 : element.Name();
}

bool is(const XMLElement& element, const char* name) {
  return std::strcmp(local_name(element), name) == 0;
}

// The value of an attribute; 0 where it is no whole number.
std::uint64_t number(const XMLElement& element, const char* attribute, std::uint64_t absent) {
  const char* text = element.Attribute(attribute);
  if (text == nullptr) return absent;
  std::uint64_t value = 0;
  if (text[std::strspn(text, "0123456789")] != '\0') return 0;
  return element.QueryUnsigned64Attribute(attribute, &value) == tinyxml2::XML_SUCCESS ? value : 0;
}

std::uint64_t children(const XMLElement& element, const char* name) {
  std::uint64_t count = 0;
  for (const XMLElement* child = element.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    count += is(*child, name) ? 1 : 0;
  }
  return count;
}

constexpr const char* kSpace = " \t\r\n";

// The numbers of a list.
std::uint64_t words(const XMLElement& list) {
  std::uint64_t count = 0;
  for (const tinyxml2::XMLNode* node = list.FirstChild(); node != nullptr;
       node = node->NextSibling()) {
    const char* at = node->ToText() != nullptr ? node->Value() : "";
    while (*(at += std::strspn(at, kSpace)) != '\0') {
      at += std::strcspn(at, kSpace);
      ++count;
    }
  }
  return count;
}

bool is_primitives(const XMLElement& element) {
  for (const char* name :
       {"triangles", "lines", "polylist", "polygons", "tristrips", "trifans", "linestrips"}) {
    if (is(element, name)) return true;
  }
  return false;
}

// Whether primitives announce nothing and hold no indices, as exporters write a material without
// faces.
bool is_empty(const XMLElement& primitives) {
  std::uint64_t indices = 0;
  for (const XMLElement* child = primitives.FirstChildElement(); child != nullptr;
       child = child->NextSiblingElement()) {
    if (is(*child, "p")) indices += words(*child);
  }
  const char* count = primitives.Attribute("count");
  return indices == 0 && count != nullptr && std::strcmp(count, "0") == 0;
}

/// Visits every element; ends at the first one that assimp would not survive.
class Check : public tinyxml2::XMLVisitor {
 public:
  bool VisitEnter(const XMLElement& element, const tinyxml2::XMLAttribute*) override {
    if (is(element, "source")) floats_ = 0;
    if (is(element, "float_array")) floats_ = number(element, "count", 0);
    if (is(element, "accessor")) check_accessor(element);
    if (is(element, "skew")) {  // an assertion of assimp ends the program
      fault_ = "has a <skew> (line " + std::to_string(element.GetLineNum()) +
               "), which is not read; write it as a <matrix>, or apply it to the vertices";
    }
    note_reference(element);
    if (is_primitives(element)) check_primitives(element);
    if (is(element, "p") || is(element, "v") || is(element, "vcount")) check_indices(element);
    return fault_.empty();
  }

  /// Primitives without any: assimp does not survive all of them.
  const std::vector<const XMLElement*>& empty() const { return empty_; }

  /// To be asked after the visit.
  std::string fault() const {
    if (!fault_.empty()) return fault_;
    for (const auto& [url, where] : urls_) {
      if (ids_.count(url) > 0) continue;
      return "names '" + url.substr(0, 60) + "' in <" + where +
             "), which it does not hold: a part would be missing. Export or download it again";
    }
    return "";
  }

 private:
  // Assimp leaves out what is named and not there.
  void note_reference(const XMLElement& element) {
    if (const char* id = element.Attribute("id")) ids_.insert(std::string("#") + id);
    if (!is(element, "instance_geometry") && !is(element, "instance_node") &&
        !is(element, "instance_controller")) {
      return;
    }
    const char* url = element.Attribute("url");
    urls_.emplace_back(url != nullptr ? url : "", std::string(local_name(element)) + "> (line " +
                                                      std::to_string(element.GetLineNum()));
  }

  void fail(const XMLElement& element, const std::string& what) {
    fault_ = "holds " + what + " in <" + local_name(element) + "> (line " +
             std::to_string(element.GetLineNum()) +
             "): the file is damaged, export or download it again";
  }

  // Checks that an accessor reads no more than its source's array holds; assimp reads past the end.
  void check_accessor(const XMLElement& element) {
    const XMLElement* source =
        element.Parent()->Parent() != nullptr ? element.Parent()->Parent()->ToElement() : nullptr;
    // Arrays of names, of joints for example, hold no coordinates.
    if (source == nullptr ||
        children(*source, "Name_array") + children(*source, "IDREF_array") > 0) {
      return;
    }
    const std::uint64_t count = number(element, "count", 0), stride = number(element, "stride", 1),
                        offset = number(element, "offset", 0);
    const bool fits = count == 0 || (offset <= floats_ && stride <= (floats_ - offset) / count);
    if (fits) return;
    fail(element, std::to_string(count) + " times " + std::to_string(stride) + " numbers from " +
                      std::to_string(offset) + " on, of " + std::to_string(floats_) +
                      " that its <float_array> announces,");
  }

  // Assimp ends the program where there are fewer lists of indices than announced.
  void check_primitives(const XMLElement& element) {
    if (is_empty(element)) return empty_.push_back(&element);
    if (is(element, "linestrips")) return;
    if (is(element, "tristrips") || is(element, "trifans")) return check_strips(element);
    const std::uint64_t count = number(element, "count", 0), lists = children(element, "p");
    const std::uint64_t wanted =
        is(element, "polygons") ? count : std::min<std::uint64_t>(count, 1);
    if (lists == wanted) return;
    fail(element, std::to_string(lists) + " <p> for a count of " + std::to_string(count));
  }

  // The same where a strip has no triangle.
  void check_strips(const XMLElement& element) {
    std::uint64_t most = 0;
    for (const XMLElement* child = element.FirstChildElement(); child != nullptr;
         child = child->NextSiblingElement()) {
      if (is(*child, "input")) most = std::max(most, number(*child, "offset", 0));
      if (!is(*child, "p") || words(*child) / (most + 1) >= 3) continue;
      return fail(element, "a list of less than three corners");
    }
  }

  // Assimp does not advance at other characters, and adds indices until memory ends.
  void check_indices(const XMLElement& element) {
    for (const tinyxml2::XMLNode* node = element.FirstChild(); node != nullptr;
         node = node->NextSibling()) {
      if (node->ToText() == nullptr) continue;
      const std::string text = node->Value();
      const std::size_t at = text.find_first_not_of("0123456789+- \t\r\n");
      if (at == std::string::npos) continue;
      constexpr std::size_t kBefore = 8, kShown = 16;
      std::string part = text.substr(at - std::min(at, kBefore), kShown);
      std::replace_if(
          part.begin(), part.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
      return fail(element, "\"" + part + "\" where whole numbers must be");
    }
  }

  std::vector<const XMLElement*> empty_;
  std::set<std::string> ids_;                              ///< "#ID" of each element
  std::vector<std::pair<std::string, std::string>> urls_;  ///< what is named, and where
  std::uint64_t floats_ = 0;  ///< numbers of the source that is being visited
  std::string fault_;
};

// Assimp's own conversion differs from version to version.
std::string unit_of(const tinyxml2::XMLDocument& document) {
  const XMLElement* root = document.FirstChildElement("COLLADA");
  const XMLElement* asset = root != nullptr ? root->FirstChildElement("asset") : nullptr;
  const XMLElement* unit = asset != nullptr ? asset->FirstChildElement("unit") : nullptr;
  const char* text = unit != nullptr ? unit->Attribute("meter") : nullptr;
  return text != nullptr ? text : "";
}

}  // namespace

std::string collada_fault(const std::string& bytes, std::string* readable, std::string* unit) {
  tinyxml2::XMLDocument document;
  const tinyxml2::XMLError error = document.Parse(bytes.data(), bytes.size());
  if (error == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED) {  // assimp would nest calls as deep
    return "nests its XML elements too deep; export or download it again";
  }
  // Assimp would read on: its own XML reader takes what is not well-formed.
  if (error != tinyxml2::XML_SUCCESS) {
    return std::string("cannot be read as a mesh (XML that is not well-formed: ") +
           document.ErrorName() + ", line " + std::to_string(document.ErrorLineNum()) +
           "); export or download it again";
  }
  if (unit != nullptr) *unit = unit_of(document);
  Check check;
  document.Accept(&check);
  if (readable == nullptr || !check.fault().empty() || check.empty().empty()) return check.fault();
  for (const XMLElement* element : check.empty()) {
    document.DeleteNode(const_cast<XMLElement*>(element));
  }
  tinyxml2::XMLPrinter printer(nullptr, true);
  document.Print(&printer);
  *readable = printer.CStr();
  return "";
}

}  // namespace ist
