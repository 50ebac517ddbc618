#pragma once

#include <xmlrpcpp/XmlRpc.h>

#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ist {

/// What a numeric parameter may be: `unit` and bounds are quoted when it is something else.
struct Range {
  const char* unit = "";  ///< "m", "s", "Hz"; empty for plain numbers
  double min = 0.0;
  double max = std::numeric_limits<double>::infinity();
  bool min_excluded = false;
  bool infinite = false;  ///< whether inf itself is allowed
};

/// A number or truth value that was asked for, what it may be, and what it is.
struct Tunable {
  enum class Kind { kDouble, kInt, kBool };
  std::string name;
  Kind kind = Kind::kDouble;
  Range range;            ///< of kBool: 0 to 1
  double standard = 0.0;  ///< its default
  double value = 0.0;     ///< what holds: the default, too, where the one that is set is wrong
};

/// Reads typed values from a tree of parameters: what the parameter server holds under one
/// namespace. A parameter that is absent leaves the caller's default; one that is there but wrong
/// adds a sentence to errors(), with its name, value, unit and what is allowed, and leaves the
/// default too. So all mistakes are reported at once. Knows nothing of a ROS master.
class ParameterReader {
 public:
  /// @param tree  a struct, or an invalid value where there are no parameters at all
  explicit ParameterReader(const XmlRpc::XmlRpcValue& tree) : tree_(tree) {}

  /// NaN is never allowed. Integers are read as doubles too.
  void read(const std::string& name, const Range& range, double* value);
  void read(const std::string& name, const Range& range, int* value);
  void read(const std::string& name, bool* value);
  void read(const std::string& name, std::string* value);
  void read(const std::string& name, std::vector<std::string>* value);
  void read(const std::string& name, std::vector<std::pair<std::string, std::string>>* value);
  /// One of `choices`; `hint`, where there is one for the value found, goes behind the message.
  void read_choice(const std::string& name, const std::vector<std::string>& choices,
                   std::string* value, const std::map<std::string, std::string>& hints = {});

  bool has(const std::string& name) const;
  /// Names of the parameters one level below `name`; an error when it is no dictionary.
  std::vector<std::string> children(const std::string& name);

  /// Every double, int and bool that was asked for, in that order.
  const std::vector<Tunable>& tunables() const { return tunables_; }

  void add_error(const std::string& sentence) { errors_.push_back(sentence); }
  const std::vector<std::string>& errors() const { return errors_; }

  /// A sentence for every parameter in the tree that nobody asked for, with the nearest name that
  /// somebody did ask for.
  std::vector<std::string> unknown() const;

 private:
  const XmlRpc::XmlRpcValue* find(const std::string& name) const;
  const XmlRpc::XmlRpcValue* ask(const std::string& name);
  void wrong(const std::string& name, const XmlRpc::XmlRpcValue& value,
             const std::string& expected);
  void read_number(const std::string& name, const Range& range, double* value);
  void read_whole(const std::string& name, const Range& range, int* value);
  void read_truth(const std::string& name, bool* value);

  XmlRpc::XmlRpcValue tree_;
  std::set<std::string> asked_;
  std::vector<Tunable> tunables_;
  std::vector<std::string> errors_;
};

/// Number of insertions, deletions and replacements that turn `a` into `b`.
std::size_t edit_distance(const std::string& a, const std::string& b);

}  // namespace ist
