#pragma once

#include <cstddef>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "ist_proximity/proximity/proximity_query.h"

/// Errors of many answers, and the table in doc/accuracy.md that states their limits.
namespace ist::test {

/// Errors of one mode or one hard case, against the truth.
struct Accuracy {
  int cases = 0;
  int violations = 0;    ///< answers with a wrong bound or a wrong state
  double largest = 0.0;  ///< [m] distance - true
  double sum = 0.0;      ///< [m]
  double width = 0.0;    ///< [m] sum of distance - lower_bound

  /// @param rounding  [m] of float coordinates and of the truth
  void add(const LinkProximity& result, double truth, double max_distance, double rounding);

  double mean_error() const { return cases > 0 ? sum / cases : 0.0; }
  double mean_width() const { return cases > 0 ? width / cases : 0.0; }
};

/// Rows by name, in the order they were first asked for.
class Measured {
 public:
  Accuracy& operator[](const std::string& name);
  Accuracy* find(const std::string& name);
  const std::deque<std::pair<std::string, Accuracy>>& rows() const { return rows_; }

 private:
  std::deque<std::pair<std::string, Accuracy>> rows_;  // references stay valid
};

/// The limit that the document states for a measured value [mm]: 1, 2 or 5 times a power of ten, at
/// least 1.5 times the value (the order of a search differs between machines) and at least 1e-5,
/// but no more than the tolerance.
double stated_limit(double value, double tolerance);

/// The cells of a Markdown table between `<!-- NAME -->` and `<!-- end of NAME -->`, by row,
/// without its header.
using TableRows = std::vector<std::vector<std::string>>;

TableRows parse_table(const std::string& text, const std::string& name);

/// Puts another table between the marks of a document.
/// @returns false where the document lacks them, or cannot be written
bool replace_table(const std::string& path, const std::string& name, const std::string& table);

std::string read_text(const std::string& path);

std::string number(double value);

}  // namespace ist::test
