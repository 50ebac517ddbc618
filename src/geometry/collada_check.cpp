#include "geometry/collada_check.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cstdint>
#include <cstring>

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

/// Visits every element; ends at the first one that assimp would not survive.
class Check : public tinyxml2::XMLVisitor {
 public:
  bool VisitEnter(const XMLElement& element, const tinyxml2::XMLAttribute*) override {
    if (is(element, "source")) floats_ = 0;
    if (is(element, "float_array")) floats_ = number(element, "count", 0);
    if (is(element, "accessor")) check_accessor(element);
    if (is(element, "triangles") || is(element, "lines") || is(element, "polylist") ||
        is(element, "polygons")) {
      check_primitives(element);
    }
    if (is(element, "p") || is(element, "v") || is(element, "vcount")) check_indices(element);
    return fault_.empty();
  }

  const std::string& fault() const { return fault_; }

 private:
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
    const std::uint64_t count = number(element, "count", 0), lists = children(element, "p");
    const std::uint64_t wanted =
        is(element, "polygons") ? count : std::min<std::uint64_t>(count, 1);
    if (lists == wanted) return;
    fail(element, std::to_string(lists) + " <p> for a count of " + std::to_string(count));
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

  std::uint64_t floats_ = 0;  ///< numbers of the source that is being visited
  std::string fault_;
};

}  // namespace

std::string collada_fault(const std::string& bytes) {
  tinyxml2::XMLDocument document;
  const tinyxml2::XMLError error = document.Parse(bytes.data(), bytes.size());
  if (error == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED) return {};  // load_mesh() says that
  // Assimp would read on: its own XML reader takes what is not well-formed.
  if (error != tinyxml2::XML_SUCCESS) {
    return std::string("cannot be read as a mesh (XML that is not well-formed: ") +
           document.ErrorName() + ", line " + std::to_string(document.ErrorLineNum()) +
           "); export or download it again";
  }
  Check check;
  document.Accept(&check);
  return check.fault();
}

}  // namespace ist
