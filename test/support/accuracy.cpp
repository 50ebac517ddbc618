#include "support/accuracy.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <sstream>

namespace ist::test {
namespace {

// The first and the last place between the marks; 0 without them.
std::pair<std::size_t, std::size_t> table_place(const std::string& text, const std::string& name) {
  const std::string begin = "<!-- " + name + " -->\n", end = "<!-- end of " + name + " -->";
  const std::size_t first = text.find(begin), last = text.find(end);
  if (first == std::string::npos || last == std::string::npos) return {0, 0};
  return {first + begin.size(), last};
}

}  // namespace

void Accuracy::add(const LinkProximity& result, double truth, double max_distance,
                   double rounding) {
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

Accuracy& Measured::operator[](const std::string& name) {
  if (Accuracy* found = find(name)) return *found;
  rows_.emplace_back(name, Accuracy());
  return rows_.back().second;
}

Accuracy* Measured::find(const std::string& name) {
  for (auto& [key, row] : rows_) {
    if (key == name) return &row;
  }
  return nullptr;
}

double stated_limit(double value, double tolerance) {
  const double wanted = std::max(1.5 * value, 1e-5);
  const double decade = std::pow(10.0, std::floor(std::log10(wanted) + 1e-9));
  double limit = 10.0 * decade;
  for (const double step : {5.0, 2.0, 1.0}) {
    if (step * decade >= wanted * (1.0 - 1e-9)) limit = step * decade;
  }
  return value <= tolerance ? std::min(limit, tolerance) : limit;
}

TableRows parse_table(const std::string& text, const std::string& name) {
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

bool replace_table(const std::string& path, const std::string& name, const std::string& table) {
  std::string text = read_text(path);
  const auto [first, last] = table_place(text, name);
  if (last == 0) return false;
  text.replace(first, last - first, table);
  return static_cast<bool>(std::ofstream(path) << text);
}

std::string read_text(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

}  // namespace ist::test
