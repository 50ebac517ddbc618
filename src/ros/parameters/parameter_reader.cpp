#include "ros/parameters/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>

namespace ist {
namespace {

using XmlRpc::XmlRpcValue;

std::string shown(const XmlRpcValue& value) {
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

std::string with_unit(const std::string& value, const Range& range) {
  return *range.unit ? value + " " + range.unit : value;
}

std::string number(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

std::string allowed(const Range& range) {
  std::string text = range.min_excluded ? "more than " : "from ";
  text += number(range.min);
  if (std::isinf(range.max)) {
    text += range.infinite ? ", inf included" : range.min_excluded ? ", finite" : " up, finite";
  } else {
    text += " to " + number(range.max);
    if (range.infinite) text += ", or inf";
  }
  return with_unit(text, range);
}

bool inside(double value, const Range& range) {
  if (std::isnan(value)) return false;
  if (std::isinf(value)) return value > 0 && range.infinite;
  if (range.min_excluded ? value <= range.min : value < range.min) return false;
  return value <= range.max;
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

const XmlRpcValue* ParameterReader::ask(const std::string& name) {
  asked_.insert(name);
  return find(name);
}

bool ParameterReader::has(const std::string& name) const { return find(name) != nullptr; }

void ParameterReader::wrong(const std::string& name, const XmlRpcValue& value,
                            const std::string& expected) {
  errors_.push_back("~" + name + " is " + shown(value) + ": " + expected);
}

void ParameterReader::read(const std::string& name, const Range& range, double* value) {
  const double standard = *value;
  read_number(name, range, value);
  tunables_.push_back({name, Tunable::Kind::kDouble, range, standard, *value});
}

void ParameterReader::read(const std::string& name, const Range& range, int* value) {
  const double standard = *value;
  read_whole(name, range, value);
  tunables_.push_back({name, Tunable::Kind::kInt, range, standard, static_cast<double>(*value)});
}

void ParameterReader::read(const std::string& name, bool* value) {
  const double standard = *value ? 1.0 : 0.0;
  read_truth(name, value);
  tunables_.push_back(
      {name, Tunable::Kind::kBool, Range{"", 0.0, 1.0}, standard, *value ? 1.0 : 0.0});
}

void ParameterReader::read_number(const std::string& name, const Range& range, double* value) {
  const XmlRpcValue* found = ask(name);
  if (!found) return;
  double number_found;
  if (found->getType() == XmlRpcValue::TypeInt) {
    number_found = static_cast<const int&>(*found);
  } else if (found->getType() == XmlRpcValue::TypeDouble) {
    number_found = static_cast<const double&>(*found);
  } else {
    return wrong(name, *found, "a number is needed, " + allowed(range));
  }
  if (!inside(number_found, range)) {
    errors_.push_back("~" + name + " is " + with_unit(number(number_found), range) +
                      ": allowed is " + allowed(range));
    return;
  }
  *value = number_found;
}

void ParameterReader::read_whole(const std::string& name, const Range& range, int* value) {
  const XmlRpcValue* found = ask(name);
  if (!found) return;
  // A whole number is one however it was written: 20000, 20000.0 or 2e4.
  double as_double = *value;
  if (found->getType() == XmlRpcValue::TypeDouble) as_double = static_cast<const double&>(*found);
  if (found->getType() == XmlRpcValue::TypeInt) as_double = static_cast<const int&>(*found);
  const bool is_number =
      found->getType() == XmlRpcValue::TypeInt ||
      (found->getType() == XmlRpcValue::TypeDouble && as_double == std::floor(as_double));
  if (!is_number) return wrong(name, *found, "a whole number is needed, " + allowed(range));
  if (!inside(as_double, range)) return wrong(name, *found, "allowed is " + allowed(range));
  *value = static_cast<int>(as_double);
}

void ParameterReader::read_truth(const std::string& name, bool* value) {
  const XmlRpcValue* found = ask(name);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeBoolean) {
    return wrong(name, *found, "true or false is needed");
  }
  *value = static_cast<const bool&>(*found);
}

void ParameterReader::read(const std::string& name, std::string* value) {
  const XmlRpcValue* found = ask(name);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeString) {
    return wrong(name, *found, "a string is needed");
  }
  *value = static_cast<const std::string&>(*found);
}

void ParameterReader::read(const std::string& name, std::vector<std::string>* value) {
  const XmlRpcValue* found = ask(name);
  if (!found) return;
  if (found->getType() != XmlRpcValue::TypeArray) {
    return wrong(name, *found, "a list of strings is needed");
  }
  std::vector<std::string> strings;
  for (int i = 0; i < found->size(); ++i) {
    const XmlRpcValue& element = (*found)[i];
    if (element.getType() != XmlRpcValue::TypeString) {
      return wrong(name, element, "every element of the list must be a string");
    }
    strings.push_back(static_cast<const std::string&>(element));
  }
  *value = std::move(strings);
}

void ParameterReader::read(const std::string& name,
                           std::vector<std::pair<std::string, std::string>>* value) {
  const XmlRpcValue* found = ask(name);
  if (!found) return;
  const std::string needed = "a list of pairs of strings is needed, [[a, b], [c, d]]";
  if (found->getType() != XmlRpcValue::TypeArray) return wrong(name, *found, needed);
  std::vector<std::pair<std::string, std::string>> pairs;
  for (int i = 0; i < found->size(); ++i) {
    const XmlRpcValue& pair = (*found)[i];
    const bool is_pair = pair.getType() == XmlRpcValue::TypeArray && pair.size() == 2 &&
                         pair[0].getType() == XmlRpcValue::TypeString &&
                         pair[1].getType() == XmlRpcValue::TypeString;
    if (!is_pair) return wrong(name, pair, needed);
    pairs.emplace_back(static_cast<const std::string&>(pair[0]),
                       static_cast<const std::string&>(pair[1]));
  }
  *value = std::move(pairs);
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
  std::string list;
  for (const std::string& choice : choices) list += (list.empty() ? "" : ", ") + choice;
  const auto hint = hints.find(chosen);
  errors_.push_back("~" + name + " is \"" + chosen + "\": allowed is " + list +
                    (hint == hints.end() ? "" : " (" + hint->second + ")"));
}

std::vector<std::string> ParameterReader::children(const std::string& name) {
  std::vector<std::string> names;
  const XmlRpcValue* found = find(name);
  if (!found) return names;
  if (found->getType() != XmlRpcValue::TypeStruct) {
    ask(name);
    wrong(name, *found, "a dictionary is needed");
    return names;
  }
  for (auto& member : *found) names.push_back(member.first);
  return names;
}

std::vector<std::string> ParameterReader::unknown() const {
  std::vector<std::string> leaves, sentences;
  collect_leaves(tree_, "", &leaves);
  for (const std::string& leaf : leaves) {
    if (asked_.count(leaf) > 0) continue;
    std::string nearest;
    std::size_t smallest = std::max<std::size_t>(2, leaf.size() / 3) + 1;
    for (const std::string& name : asked_) {
      const std::size_t distance = edit_distance(leaf, name);
      if (distance < smallest) {
        smallest = distance;
        nearest = name;
      }
    }
    sentences.push_back("unknown parameter ~" + leaf + " has no effect" +
                        (nearest.empty() ? "" : "; did you mean ~" + nearest + "?"));
  }
  return sentences;
}

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row[b.size()];
}

}  // namespace ist
