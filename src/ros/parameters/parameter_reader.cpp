#include "ros/parameters/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "ros/common/text.h"
#include "ros/parameters/nearest_name.h"

namespace ist {
namespace {

using XmlRpc::XmlRpcValue;

std::string value_text(const XmlRpcValue& value) {
  std::ostringstream out;
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      out << (static_cast<const bool&>(value) ? "true" : "false");
      break;
    case XmlRpcValue::TypeInt:
      out << static_cast<const int&>(value);
      break;
    case XmlRpcValue::TypeDouble:
      out << static_cast<const double&>(value);
      break;
    case XmlRpcValue::TypeString:
      out << '"' << static_cast<const std::string&>(value) << '"';
      break;
    case XmlRpcValue::TypeArray:
      out << "a list of " << value.size();
      break;
    case XmlRpcValue::TypeStruct:
      out << "a dictionary of " << value.size();
      break;
    default:
      out << "of an unusual type";
  }
  return out.str();
}

void collect_leaves(const XmlRpcValue& value, const std::string& path,
                    std::vector<std::string>* leaves) {
  if (value.getType() != XmlRpcValue::TypeStruct) {
    if (value.valid()) leaves->push_back(path);
    return;
  }
  for (auto& member : value) {
    collect_leaves(member.second, path.empty() ? member.first : path + "/" + member.first, leaves);
  }
}

}  // namespace

const XmlRpcValue* ParameterReader::find(const std::string& name) const {
  const XmlRpcValue* value = &tree_;
  std::istringstream path(name);
  std::string part;
  while (std::getline(path, part, '/')) {
    if (value->getType() != XmlRpcValue::TypeStruct || !value->hasMember(part)) return nullptr;
    value = &(*value)[part];
  }
  return value;
}

const XmlRpcValue* ParameterReader::find_and_note(const std::string& name) {
  names_read_.insert(name);
  return find(name);
}

bool ParameterReader::has(const std::string& name) const { return find(name) != nullptr; }

void ParameterReader::reject(const std::string& name, const XmlRpcValue& value,
                             const std::string& expected) {
  errors_.push_back("~" + name + " is " + value_text(value) + ": " + expected);
}

void ParameterReader::read(const std::string& name, const Range& range, double* value) {
  const double default_value = *value;
  read_number(name, range, value);
  tunables_.push_back({name, Tunable::Kind::kDouble, range, default_value, *value});
}

void ParameterReader::read(const std::string& name, const Range& range, int* value) {
  const double default_value = *value;
  read_integer(name, range, value);
  tunables_.push_back(
      {name, Tunable::Kind::kInt, range, default_value, static_cast<double>(*value)});
}

void ParameterReader::read(const std::string& name, const Range& range, std::size_t* value) {
  int number = static_cast<int>(*value);
  read(name, range, &number);
  *value = static_cast<std::size_t>(number);
}

void ParameterReader::read(const std::string& name, bool* value) {
  const double default_value = *value ? 1.0 : 0.0;
  read_bool(name, value);
  tunables_.push_back(
      {name, Tunable::Kind::kBool, Range{"", 0.0, 1.0}, default_value, *value ? 1.0 : 0.0});
}

void ParameterReader::read_number(const std::string& name, const Range& range, double* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  double number_found;
  if (found->getType() == XmlRpcValue::TypeInt) {
    number_found = static_cast<const int&>(*found);
  } else if (found->getType() == XmlRpcValue::TypeDouble) {
    number_found = static_cast<const double&>(*found);
  } else {
    return reject(name, *found, "a number is needed, " + range.text());
  }
  if (!range.contains(number_found)) {
    errors_.push_back("~" + name + " is " + with_unit(number_text(number_found), range) +
                      ": allowed is " + range.text());
    return;
  }
  *value = number_found;
}

void ParameterReader::read_integer(const std::string& name, const Range& range, int* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  // A whole number may be written as 20000, 20000.0 or 2e4.
  double as_double = *value;
  if (found->getType() == XmlRpcValue::TypeDouble) as_double = static_cast<const double&>(*found);
  if (found->getType() == XmlRpcValue::TypeInt) as_double = static_cast<const int&>(*found);
  const bool is_number =
      found->getType() == XmlRpcValue::TypeInt ||
      (found->getType() == XmlRpcValue::TypeDouble && as_double == std::floor(as_double));
  if (!is_number) return reject(name, *found, "a whole number is needed, " + range.text());
  if (!range.contains(as_double)) return reject(name, *found, "allowed is " + range.text());
  *value = static_cast<int>(as_double);
}

void ParameterReader::read_bool(const std::string& name, bool* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeBoolean) {
    return reject(name, *found, "true or false is needed");
  }
  *value = static_cast<const bool&>(*found);
}

void ParameterReader::read(const std::string& name, std::string* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeString) {
    return reject(name, *found, "a string is needed");
  }
  *value = static_cast<const std::string&>(*found);
}

void ParameterReader::read(const std::string& name, std::vector<std::string>* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeArray) {
    return reject(name, *found, "a list of strings is needed");
  }
  std::vector<std::string> strings;
  for (int i = 0; i < found->size(); ++i) {
    const XmlRpcValue& element = (*found)[i];
    if (element.getType() != XmlRpcValue::TypeString) {
      return reject(name, element, "every element of the list must be a string");
    }
    strings.push_back(static_cast<const std::string&>(element));
  }
  *value = std::move(strings);
}

void ParameterReader::read(const std::string& name, const Range& range, std::size_t count,
                           std::vector<double>* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  const std::string needed =
      "a list of " + std::to_string(count) + " numbers is needed, each " + range.text();
  if (found->getType() != XmlRpcValue::TypeArray ||
      static_cast<std::size_t>(found->size()) != count) {
    return reject(name, *found, needed);
  }
  std::vector<double> numbers;
  for (int i = 0; i < found->size(); ++i) {
    const XmlRpcValue& element = (*found)[i];
    double number = std::nan("");
    if (element.getType() == XmlRpcValue::TypeInt) number = static_cast<const int&>(element);
    if (element.getType() == XmlRpcValue::TypeDouble) number = static_cast<const double&>(element);
    if (!range.contains(number)) return reject(name, element, needed);
    numbers.push_back(number);
  }
  *value = std::move(numbers);
}

void ParameterReader::read(const std::string& name,
                           std::vector<std::pair<std::string, std::string>>* value) {
  const XmlRpcValue* found = find_and_note(name);
  if (!found) return;
  const std::string needed = "a list of pairs of strings is needed, [[a, b], [c, d]]";
  if (found->getType() != XmlRpcValue::TypeArray) return reject(name, *found, needed);
  std::vector<std::pair<std::string, std::string>> pairs;
  for (int i = 0; i < found->size(); ++i) {
    const XmlRpcValue& pair = (*found)[i];
    const bool is_pair = pair.getType() == XmlRpcValue::TypeArray && pair.size() == 2 &&
                         pair[0].getType() == XmlRpcValue::TypeString &&
                         pair[1].getType() == XmlRpcValue::TypeString;
    if (!is_pair) return reject(name, pair, needed);
    pairs.emplace_back(static_cast<const std::string&>(pair[0]),
                       static_cast<const std::string&>(pair[1]));
  }
  *value = std::move(pairs);
}

void ParameterReader::read_switch(const std::string& name, std::string* value) {
  const XmlRpcValue* found = find(name);
  if (found && found->getType() == XmlRpcValue::TypeBoolean) {
    names_read_.insert(name);
    *value = static_cast<const bool&>(*found) ? "true" : "false";
    return;
  }
  read_choice(name, {"auto", "true", "false"}, value);
}

void ParameterReader::read_choice(const std::string& name, const std::vector<std::string>& choices,
                                  std::string* value,
                                  const std::map<std::string, std::string>& hints) {
  std::string chosen = *value;
  read(name, &chosen);
  if (std::find(choices.begin(), choices.end(), chosen) != choices.end()) {
    *value = chosen;
    return;
  }
  const auto hint = hints.find(chosen);
  errors_.push_back("~" + name + " is \"" + chosen + "\": allowed is " + join(choices, ", ") +
                    (hint == hints.end() ? "" : " (" + hint->second + ")"));
}

std::vector<std::string> ParameterReader::children(const std::string& name) {
  std::vector<std::string> names;
  const XmlRpcValue* found = find(name);
  if (!found) return names;
  if (found->getType() != XmlRpcValue::TypeStruct) {
    find_and_note(name);
    reject(name, *found, "a dictionary is needed");
    return names;
  }
  for (auto& member : *found) names.push_back(member.first);
  return names;
}

std::vector<std::string> ParameterReader::unknown() const {
  std::vector<std::string> leaves, sentences;
  collect_leaves(tree_, "", &leaves);
  for (const std::string& leaf : leaves) {
    if (names_read_.count(leaf) > 0) continue;
    const std::string nearest = nearest_name(leaf, names_read_);
    sentences.push_back("unknown parameter ~" + leaf + " has no effect" +
                        (nearest.empty() ? "" : "; did you mean ~" + nearest + "?"));
  }
  return sentences;
}

}  // namespace ist
