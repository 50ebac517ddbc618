#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace ist {

/// The values that a numeric parameter may have. Error messages quote the unit and the bounds.
struct Range {
  const char* unit = "";  ///< "m", "s", "Hz"; empty for plain numbers
  double min = 0.0;
  double max = std::numeric_limits<double>::infinity();
  bool min_excluded = false;
  bool infinite = false;  ///< whether inf itself is allowed

  /// More than 0, up to max; `infinite` allows inf as well.
  static Range positive(const char* unit, double max, bool infinite = false) {
    return {unit, 0.0, max, true, infinite};
  }
  /// Not less than 0, up to max.
  static Range non_negative(const char* unit, double max) { return {unit, 0.0, max, false, false}; }

  /// NaN is never inside.
  bool contains(double value) const;
  /// "more than 0 to 10 m"
  std::string text() const;
};

/// The text of a number with six significant digits.
std::string number_text(double value);
/// A value and its unit, where there is one: "0.5 m".
std::string with_unit(const std::string& value, const Range& range);

/// A word of a list. Where "true" is in it, truth values are accepted too.
struct Choice {
  std::vector<std::string> words;
  std::function<void(std::size_t)> set;
  std::size_t current = 0;
};
/// @param words  in the order of the values, from 0 on
template <class Enum>
Choice choice(Enum* value, std::vector<std::string> words) {
  return {std::move(words), [value](std::size_t i) { *value = static_cast<Enum>(i); },
          static_cast<std::size_t>(*value)};
}

/// An absolute path, or an empty one.
struct Path {
  std::string* path;
};

/// A word of a list, or a value that is no string.
struct WordOr {
  Choice word;
  std::variant<double*, std::vector<std::string>*> other;
  std::function<void()> note_other = [] {};  ///< called where it is the other one
};

/// Lists the values of a tree that are no dictionaries, by name.
/// @param path  the tree's own
std::map<std::string, XmlRpc::XmlRpcValue> leaves_of(const XmlRpc::XmlRpcValue& tree,
                                                     const std::string& path = "");

using NamePairs = std::vector<std::pair<std::string, std::string>>;

/// One row of a table of parameters. The place of the value holds the default.
struct Parameter {
  static constexpr double kStartOnly = -1.0;
  using Value =
      std::variant<double*, int*, std::size_t*, bool*, std::string*, std::vector<std::string>*,
                   NamePairs*, Eigen::Vector3d*, Path, Choice, WordOr>;

  std::string name;  ///< with slashes, such as "query/margin"
  Value value;
  Range range = {};       ///< of numbers; of an int or a size within what an int holds
  const char* help = "";  ///< a sentence
  /// The parameter may change while the node runs, and its slider ends here, or where 0 at
  /// ~max_distance; kStartOnly: it is read at the start only.
  double slider = kStartOnly;
  /// `noise: kinect_v1` stands for `noise/sensor: kinect_v1`.
  bool may_stand_alone = false;

  bool is_live() const { return slider != kStartOnly; }
  /// A double, or a truth value as 0 or 1: all live parameters are one of these.
  double number() const;
  bool is_bool() const { return std::holds_alternative<bool*>(value); }
};

/// Reads parameters from a tree, as the parameter server holds it under one namespace. A parameter
/// that is absent leaves the default. A parameter that is wrong leaves the default too and adds a
/// sentence to errors() with its name, value, unit and range, so that all mistakes are reported at
/// once. The reader needs no ROS master.
class ParameterReader {
 public:
  /// @param tree  a struct, or an invalid value where there are no parameters at all
  explicit ParameterReader(const XmlRpc::XmlRpcValue& tree) : tree_(tree) {}

  /// Reads a row. NaN is never allowed; a whole number may be written as 20000, 20000.0 or 2e4.
  void read(const Parameter& parameter);
  void read_all(const std::vector<Parameter>& parameters) {
    for (const Parameter& parameter : parameters) read(parameter);
  }

  /// Reads the numbers of a dictionary whose names are not known before, `default` aside.
  void read_by_name(const std::string& name, const Range& range,
                    std::map<std::string, double>* numbers);

  bool has(const std::string& name) const { return find(name) != nullptr; }
  /// Lists the names one level below `name`; adds an error when it is not a dictionary.
  std::vector<std::string> children(const std::string& name);

  void add_error(const std::string& sentence) { errors_.push_back(sentence); }
  /// Adds "~NAME TEXT".
  void add_error(const std::string& name, const std::string& text) {
    errors_.push_back("~" + name + " " + text);
  }
  const std::vector<std::string>& errors() const { return errors_; }

  /// Gives a sentence for every parameter in the tree that was not read, with the nearest name that
  /// was.
  std::vector<std::string> unknown() const;

 private:
  const XmlRpc::XmlRpcValue* find(const std::string& name) const;
  bool is_dictionary(const std::string& name);

  XmlRpc::XmlRpcValue tree_;
  /// Names that were read; those that are no dictionaries, by mistake or because they stand alone.
  std::set<std::string> names_read_, no_dictionaries_;
  std::vector<std::string> errors_;
};

}  // namespace ist
