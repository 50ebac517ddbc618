#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "ros/parameters/range.h"

namespace ist {

/// A number or truth value that was asked for: its range, its default and its value.
struct Tunable {
  enum class Kind { kDouble, kInt, kBool };
  std::string name;
  Kind kind = Kind::kDouble;
  Range range;  ///< 0 to 1 for kBool
  double default_value = 0.0;
  double value = 0.0;  ///< the value in use; the default where the one that is set is wrong
};

/// Reads typed values from a tree of parameters, as the parameter server holds it under one
/// namespace. A parameter that is absent leaves the caller's default. A parameter that is wrong
/// leaves the default too and adds a sentence to errors() with its name, value, unit and range, so
/// that all mistakes are reported at once. The reader needs no ROS master.
class ParameterReader {
 public:
  /// @param tree  a struct, or an invalid value where there are no parameters at all
  explicit ParameterReader(const XmlRpc::XmlRpcValue& tree) : tree_(tree) {}

  /// Reads a number; an integer is accepted for a double. NaN is never allowed.
  void read(const std::string& name, const Range& range, double* value);
  void read(const std::string& name, const Range& range, int* value);
  /// @param range  within what an int holds, as a parameter does; so is the default
  void read(const std::string& name, const Range& range, std::size_t* value);
  void read(const std::string& name, bool* value);
  void read(const std::string& name, std::string* value);
  void read(const std::string& name, std::vector<std::string>* value);
  /// Reads a list of `count` numbers.
  void read(const std::string& name, const Range& range, std::size_t count,
            std::vector<double>* value);
  void read(const std::string& name, std::vector<std::pair<std::string, std::string>>* value);
  /// Reads one of `choices`. The hint for the value found, if there is one, follows the error.
  void read_choice(const std::string& name, const std::vector<std::string>& choices,
                   std::string* value, const std::map<std::string, std::string>& hints = {});

  /// Reads "auto", "true" or "false"; true and false may be truth values as well.
  void read_switch(const std::string& name, std::string* value);

  bool has(const std::string& name) const;
  /// Lists the names one level below `name`; adds an error when it is not a dictionary.
  std::vector<std::string> children(const std::string& name);

  /// Lists every double, int and bool in the order in which they were read.
  const std::vector<Tunable>& tunables() const { return tunables_; }

  void add_error(const std::string& sentence) { errors_.push_back(sentence); }
  const std::vector<std::string>& errors() const { return errors_; }

  /// Gives a sentence for every parameter in the tree that was not read, with the nearest name that
  /// was.
  std::vector<std::string> unknown() const;

 private:
  const XmlRpc::XmlRpcValue* find(const std::string& name) const;
  const XmlRpc::XmlRpcValue* find_and_note(const std::string& name);
  void reject(const std::string& name, const XmlRpc::XmlRpcValue& value,
              const std::string& expected);
  void read_number(const std::string& name, const Range& range, double* value);
  void read_integer(const std::string& name, const Range& range, int* value);
  void read_bool(const std::string& name, bool* value);

  XmlRpc::XmlRpcValue tree_;
  std::set<std::string> names_read_;
  std::vector<Tunable> tunables_;
  std::vector<std::string> errors_;
};

}  // namespace ist
