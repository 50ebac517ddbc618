#include "ros/parameters/parameter_reader.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>

#include "ros/common/text.h"

namespace ist {
namespace {

using XmlRpc::XmlRpcValue;

std::string value_text(const XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpcValue::TypeBoolean:
      return static_cast<const bool&>(value) ? "true" : "false";
    case XmlRpcValue::TypeInt:
      return std::to_string(static_cast<const int&>(value));
    case XmlRpcValue::TypeDouble:
      return number_text(static_cast<const double&>(value));
    case XmlRpcValue::TypeString:
      return '"' + static_cast<const std::string&>(value) + '"';
    case XmlRpcValue::TypeArray:
      return "a list of " + std::to_string(value.size());
    case XmlRpcValue::TypeStruct:
      return "a dictionary of " + std::to_string(value.size());
    default:
      return "of an unusual type";
  }
}

std::optional<double> number_in(const XmlRpcValue& value) {
  if (value.getType() == XmlRpcValue::TypeInt) return static_cast<const int&>(value);
  if (value.getType() == XmlRpcValue::TypeDouble) return static_cast<const double&>(value);
  return std::nullopt;
}

std::optional<std::string> text_in(const XmlRpcValue& value) {
  if (value.getType() != XmlRpcValue::TypeString) return std::nullopt;
  return static_cast<const std::string&>(value);
}

/// Takes a value for the place of a parameter. Where it is wrong, the place stays as it is.
struct Taker {
  const XmlRpcValue* value;  ///< in a list, the element that is wrong
  const Range& range;
  std::string needed;  ///< what it has to be, where it is wrong

  void operator()(double* place) {
    const std::optional<double> number = number_in(*value);
    if (!number) {
      needed = "a number is needed, " + range.text();
    } else if (!range.contains(*number)) {
      needed = "allowed is " + range.text();
    } else {
      *place = *number;
    }
  }

  void operator()(int* place) { take_integer(place); }
  void operator()(std::size_t* place) { take_integer(place); }
  template <class Integer>
  void take_integer(Integer* place) {
    const std::optional<double> found = number_in(*value);
    double number = 0.0;
    (*this)(&number);
    if (!found || (needed.empty() && number != std::floor(number))) {
      needed = "a whole number is needed, " + range.text();
    } else if (needed.empty()) {
      *place = static_cast<Integer>(number);
    }
  }

  void operator()(bool* place) {
    if (value->getType() != XmlRpcValue::TypeBoolean) {
      needed = "true or false is needed";
    } else {
      *place = static_cast<const bool&>(*value);
    }
  }

  void operator()(std::string* place) {
    const std::optional<std::string> text = text_in(*value);
    if (!text) needed = "a string is needed";
    *place = text.value_or(*place);
  }

  void operator()(Path place) {
    const std::optional<std::string> text = text_in(*value);
    if (text && (text->empty() || (*text)[0] == '/')) {
      *place.path = *text;
    } else {
      needed = "an absolute path is needed, for example /home/robot/NAME";
    }
  }

  void operator()(const WordOr& either) {
    if (value->getType() == XmlRpcValue::TypeString) {
      (*this)(either.word);
    } else {
      std::visit(*this, either.other);
      if (needed.empty()) either.note_other();
    }
  }

  void operator()(const Choice& choice) {
    const bool is_bool = value->getType() == XmlRpcValue::TypeBoolean;
    const std::string word = is_bool ? value_text(*value) : text_in(*value).value_or("");
    const auto found = std::find(choice.words.begin(), choice.words.end(), word);
    if (found == choice.words.end()) {
      needed = "allowed is " + join(choice.words, ", ");
    } else {
      choice.set(static_cast<std::size_t>(found - choice.words.begin()));
    }
  }

  void operator()(Eigen::Vector3d* place) {
    std::vector<double> taken;
    take_list(
        "a list of 3 numbers is needed, each " + range.text(),
        [&](const XmlRpcValue& element) {
          taken.push_back(number_in(element).value_or(std::nan("")));
          return range.contains(taken.back());
        },
        3);
    if (needed.empty()) *place = Eigen::Vector3d(taken.data());
  }

  void operator()(std::vector<std::string>* place) {
    std::vector<std::string> taken;
    take_list("a list of strings is needed", [&](const XmlRpcValue& element) {
      taken.push_back(text_in(element).value_or(""));
      return text_in(element).has_value();
    });
    if (needed.empty()) *place = std::move(taken);
  }

  void operator()(NamePairs* place) {
    NamePairs taken;
    take_list("a list of pairs of strings is needed, [[a, b], [c, d]]",
              [&](const XmlRpcValue& pair) {
                if (pair.getType() != XmlRpcValue::TypeArray || pair.size() != 2) return false;
                taken.emplace_back(text_in(pair[0]).value_or(""), text_in(pair[1]).value_or(""));
                return text_in(pair[0]) && text_in(pair[1]);
              });
    if (needed.empty()) *place = std::move(taken);
  }

  /// @param count  of elements; -1: any
  template <class Take>
  void take_list(const std::string& what, Take take, int count = -1) {
    const XmlRpcValue& list = *value;
    const bool is_list = list.getType() == XmlRpcValue::TypeArray;
    if (!is_list || (count >= 0 && list.size() != count)) {
      needed = what;
      return;
    }
    for (int i = 0; i < list.size() && needed.empty(); ++i) {
      if (take(list[i])) continue;
      value = &list[i];
      needed = what;
    }
  }
};

}  // namespace

std::map<std::string, XmlRpcValue> leaves_of(const XmlRpcValue& tree, const std::string& path) {
  if (tree.getType() != XmlRpcValue::TypeStruct) {
    return tree.valid() && !path.empty() ? std::map{std::pair(path, tree)}
                                         : std::map<std::string, XmlRpcValue>();
  }
  std::map<std::string, XmlRpcValue> leaves;
  for (auto& [name, value] : tree) {
    leaves.merge(leaves_of(value, path.empty() ? name : path + "/" + name));
  }
  return leaves;
}

std::string number_text(double value) { return format_text("%g", value); }

std::string with_unit(const std::string& value, const Range& range) {
  return *range.unit ? value + " " + range.unit : value;
}

bool Range::contains(double value) const {
  if (std::isnan(value)) return false;
  if (std::isinf(value)) return value > 0 && infinite;
  if (min_excluded ? value <= min : value < min) return false;
  return value <= max;
}

std::string Range::text() const {
  std::string text = (min_excluded ? "more than " : "from ") + number_text(min);
  if (!std::isinf(max)) {
    return with_unit(text + " to " + number_text(max) + (infinite ? ", or inf" : ""), *this);
  }
  if (!min_excluded) text += " up";
  return with_unit(text, *this) + (infinite ? ", inf included" : ", finite");
}

double Parameter::number() const {
  return is_bool() ? *std::get<bool*>(value) : *std::get<double*>(value);
}

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

/// Whether parameters may be below this name; adds an error, once, where something else is there.
bool ParameterReader::is_dictionary(const std::string& name) {
  const XmlRpcValue* found = find(name);
  if (!found || found->getType() == XmlRpcValue::TypeStruct) return true;
  if (no_dictionaries_.insert(name).second) {
    add_error(name, "is " + value_text(*found) + ": a dictionary is needed");
  }
  return false;
}

void ParameterReader::read(const Parameter& parameter) {
  std::string name = parameter.name;
  if (!names_read_.insert(name).second) return;  // its mistake is told once
  if (parameter.may_stand_alone) {
    const std::string alone = name.substr(0, name.rfind('/'));
    const XmlRpcValue* value = find(alone);
    const bool stands_alone = value && value->getType() != XmlRpcValue::TypeStruct;
    if (stands_alone) no_dictionaries_.insert(name = alone);  // nothing is read below it
    names_read_.insert(name);
  }
  for (std::size_t i = name.find('/'); i != std::string::npos; i = name.find('/', i + 1)) {
    if (!is_dictionary(name.substr(0, i))) return;
  }
  Taker taker{find(name), parameter.range, ""};
  if (!taker.value) return;
  std::visit(taker, parameter.value);
  if (taker.needed.empty()) return;
  const std::string text = value_text(*taker.value);
  add_error(name, "is " + (number_in(*taker.value) ? with_unit(text, parameter.range) : text) +
                      ": " + taker.needed);
}

std::vector<std::string> ParameterReader::children(const std::string& name) {
  std::vector<std::string> names;
  if (!has(name) || !is_dictionary(name)) return names;
  for (auto& member : *find(name)) names.push_back(member.first);
  return names;
}

void ParameterReader::read_by_name(const std::string& name, const Range& range,
                                   std::map<std::string, double>* numbers) {
  for (const std::string& child : children(name)) {
    if (child != "default") read({name + "/" + child, &(*numbers)[child], range});
  }
}

std::vector<std::string> ParameterReader::unknown() const {
  std::vector<std::string> sentences;
  for (const auto& [leaf, value] : leaves_of(tree_)) {
    if (names_read_.count(leaf) > 0) continue;
    const std::string nearest = nearest_name(leaf, names_read_);
    sentences.push_back("unknown parameter ~" + leaf + " has no effect" +
                        (nearest.empty() ? "" : "; did you mean ~" + nearest + "?"));
  }
  return sentences;
}

}  // namespace ist
