#include "ros/parameters/range.h"

#include <cmath>
#include <sstream>

namespace ist {

std::string number_text(double value) {
  std::ostringstream out;
  out << value;
  return out.str();
}

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
  std::string text = min_excluded ? "more than " : "from ";
  text += number_text(min);
  if (std::isinf(max)) {
    text += infinite ? ", inf included" : min_excluded ? ", finite" : " up, finite";
  } else {
    text += " to " + number_text(max);
    if (infinite) text += ", or inf";
  }
  return with_unit(text, *this);
}

}  // namespace ist
