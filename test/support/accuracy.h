#pragma once

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <deque>
#include <fstream>
#include <sstream>
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
  void add(const LinkProximity& result, double truth, double max_distance, double rounding) {
    ++cases;
    if (result.state == LinkState::kUnknown) {
      ++violations;
      return;
    }
    if (result.lower_bound > truth + rounding || result.distance < truth - rounding) ++violations;
    if (result.state == LinkState::kClear) {
      if (truth < max_distance) ++violations;
      return;
    }
    const bool is_contact = result.state == LinkState::kContact;
    if (std::abs(truth) > rounding && is_contact != (truth < 0.0)) ++violations;
    const double error = std::abs(result.distance - truth);
    largest = std::max(largest, error);
    sum += error;
    width += result.distance - result.lower_bound;
  }

  double mean_error() const { return cases > 0 ? sum / cases : 0.0; }
  double mean_width() const { return cases > 0 ? width / cases : 0.0; }
};

/// Rows by name, in the order they were first asked for.
class Measured {
 public:
  Accuracy& operator[](const std::string& name) {
    if (Accuracy* found = find(name)) return *found;
    rows_.emplace_back(name, Accuracy());
    return rows_.back().second;
  }
  Accuracy* find(const std::string& name) {
    for (auto& [key, row] : rows_) {
      if (key == name) return &row;
    }
    return nullptr;
  }
  const std::deque<std::pair<std::string, Accuracy>>& rows() const { return rows_; }

 private:
  std::deque<std::pair<std::string, Accuracy>> rows_;  // references stay valid
};

/// The limit that the document states for a measured value [mm]: 1, 2 or 5 times a power of ten, at
/// least 1.5 times the value (the order of a search differs between machines) and at least 1e-5,
/// but no more than the tolerance.
inline double stated_limit(double value, double tolerance) {
  const double wanted = std::max(1.5 * value, 1e-5);
  const double decade = std::pow(10.0, std::floor(std::log10(wanted) + 1e-9));
  double limit = 10.0 * decade;
  for (const double step : {5.0, 2.0, 1.0}) {
    if (step * decade >= wanted * (1.0 - 1e-9)) limit = step * decade;
  }
  return value <= tolerance ? std::min(limit, tolerance) : limit;
}

/// The cells of a Markdown table between `<!-- NAME -->` and `<!-- end of NAME -->`, by row,
/// without its header.
using TableRows = std::vector<std::vector<std::string>>;

inline std::pair<std::size_t, std::size_t> table_place(const std::string& text,
                                                       const std::string& name) {
  const std::string begin = "<!-- " + name + " -->\n", end = "<!-- end of " + name + " -->";
  const std::size_t first = text.find(begin), last = text.find(end);
  if (first == std::string::npos || last == std::string::npos) return {0, 0};
  return {first + begin.size(), last};
}

inline TableRows parse_table(const std::string& text, const std::string& name) {
  const auto [first, last] = table_place(text, name);
  std::istringstream lines(text.substr(first, last - first));
  TableRows rows;
  std::string line;
  for (int number = 0; std::getline(lines, line);) {
    if (line.empty() || line[0] != '|' || ++number <= 2) continue;
    std::istringstream cells(line.substr(1));
    std::vector<std::string> row;
    for (std::string cell; std::getline(cells, cell, '|');) {
      const std::size_t from = cell.find_first_not_of(' '), to = cell.find_last_not_of(' ');
      row.push_back(from == std::string::npos ? "" : cell.substr(from, to - from + 1));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

inline std::string read_text(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

}  // namespace ist::test
