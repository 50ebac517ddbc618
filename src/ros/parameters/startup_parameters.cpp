#include "ros/parameters/startup_parameters.h"

#include <set>
#include <sstream>
#include <vector>

#include "ros/common/text.h"
#include "ros/parameters/range.h"

namespace ist {
namespace {

using XmlRpc::XmlRpcValue;
using Values = std::map<std::string, std::string>;

// Values of one parameter are compared and shown as text.
std::string text_of(const XmlRpcValue& value) {
  if (value.getType() == XmlRpcValue::TypeDouble) {
    return number_text(static_cast<const double&>(value));
  }
  std::ostringstream text;
  text << value;
  return text.str();
}

void collect(const XmlRpcValue& value, const std::string& name, const std::set<std::string>& live,
             Values* values) {
  if (value.getType() == XmlRpcValue::TypeStruct) {
    XmlRpcValue members = value;  // its iterators are not const
    const std::string prefix = name.empty() ? "" : name + "/";
    for (auto& [key, member] : members) collect(member, prefix + key, live, values);
  } else if (!name.empty() && value.valid() && live.count(name) == 0) {
    (*values)[name] = text_of(value);
  }
}

// @param before  the value in use; null: it was not set
std::string change_text(const std::string& name, const std::string& value,
                        const std::string* before) {
  if (before == nullptr) return "~" + name + " has been set to " + value;
  return "~" + name + " is " + value + ", in use is " + *before;
}

}  // namespace

std::string StartupParameters::changes(const XmlRpcValue& tree, const std::vector<Tunable>& live) {
  std::set<std::string> names;
  for (const Tunable& tunable : live) names.insert(tunable.name);
  Values now;
  if (tree.valid()) collect(tree, "", names, &now);
  if (!has_begun_) {
    has_begun_ = true;
    in_use_ = std::move(now);
    return "";
  }
  std::vector<std::string> changes;
  for (const auto& [name, value] : now) {
    const auto before = in_use_.find(name);
    const bool is_new = before == in_use_.end();
    if (!is_new && before->second == value) continue;
    changes.push_back(change_text(name, value, is_new ? nullptr : &before->second));
  }
  if (changes.empty()) return "";
  return "read at the start only, so that the node has to be restarted: " + join(changes, "; ");
}

}  // namespace ist
