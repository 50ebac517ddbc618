#include "geometry/collada_check.h"

#include <tinyxml2.h>

#include <algorithm>
#include <cstring>

namespace ist {
namespace {

/// Visits every element; ends at the first list that is not made of whole numbers.
class IndexLists : public tinyxml2::XMLVisitor {
 public:
  bool VisitEnter(const tinyxml2::XMLElement& element, const tinyxml2::XMLAttribute*) override {
    const char* name = local_name(element.Name());
    const bool is_list = std::strcmp(name, "p") == 0 || std::strcmp(name, "v") == 0 ||
                         std::strcmp(name, "vcount") == 0;
    if (!is_list) return true;
    for (const tinyxml2::XMLNode* node = element.FirstChild(); node != nullptr;
         node = node->NextSibling()) {
      const tinyxml2::XMLText* text = node->ToText();
      if (text != nullptr && !check(name, element.GetLineNum(), text->Value())) return false;
    }
    return true;
  }

  const std::string& fault() const { return fault_; }

 private:
  // The name without the prefix of its namespace.
  static const char* local_name(const char* name) {
    const char* colon = std::strchr(name, ':');
    return colon != nullptr ? colon + 1 : name;
  }

  bool check(const std::string& name, int line, const std::string& text) {
    const std::size_t at = text.find_first_not_of("0123456789+- \t\r\n");
    if (at == std::string::npos) return true;
    constexpr std::size_t kBefore = 8, kShown = 16;
    std::string part = text.substr(at - std::min(at, kBefore), kShown);
    std::replace_if(
        part.begin(), part.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
    fault_ = "holds \"" + part + "\" in the indices of <" + name + "> (line " +
             std::to_string(line) +
             "); they must be whole numbers: the file is damaged, export or download it again";
    return false;
  }

  std::string fault_;
};

}  // namespace

std::string collada_fault(const std::string& bytes) {
  tinyxml2::XMLDocument document;
  if (document.Parse(bytes.data(), bytes.size()) != tinyxml2::XML_SUCCESS) return {};
  IndexLists lists;
  document.Accept(&lists);
  return lists.fault();
}

}  // namespace ist
