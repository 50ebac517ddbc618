#pragma once

#include <limits>
#include <string>

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

}  // namespace ist
