// Draws the table of growth as a picture.

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "packing/options.h"
#include "support/accuracy.h"

namespace ist::benchmark {
namespace {

constexpr double kWidth = 360.0, kHeight = 260.0, kLeft = 50.0, kTop = 30.0;  // of a panel's axes
constexpr double kPanel = 440.0;

struct Series {
  const char* name;
  const char* colour;
  std::size_t column;
  double name_y;  // below the first point
};
constexpr Series kSeries[] = {{"time [s]", "#1f6fb4", 2, 20.0},
                              {"memory [MB]", "#c4572b", 4, -24.0}};

// One log-log panel: the rows whose cell `fixed` is `value`, by the other one of the first two
// cells.
class Panel {
 public:
  Panel(double left, const test::TableRows& rows, std::size_t fixed, const std::string& value)
      : left_(left + kLeft), x_(1 - fixed) {
    for (const auto& row : rows) {
      if (row[fixed] == value) rows_.push_back(row);
    }
    std::sort(rows_.begin(), rows_.end(),
              [this](const auto& a, const auto& b) { return std::stod(a[x_]) < std::stod(b[x_]); });
    for (const auto& row : rows_) {
      grow(std::stod(row[x_]), &x_range_);
      for (const Series& series : kSeries) grow(std::stod(row[series.column]), &y_range_);
    }
  }

  void draw(const std::string& title, const std::string& what, std::ostream* svg) const {
    if (rows_.empty()) return;
    text(left_ + 0.5 * kWidth, kTop - 12, title, "#333", svg);
    text(left_ + 0.5 * kWidth, kTop + kHeight + 36, what, "#333", svg);
    for (double e = x_range_.first; e <= x_range_.second; ++e) {
      line({{px(e), kTop}, {px(e), kTop + kHeight}}, "#ddd", 1, svg);
      text(px(e), kTop + kHeight + 18, label(e), "#333", svg);
    }
    for (double e = y_range_.first; e <= y_range_.second; ++e) {
      line({{left_, py(e)}, {left_ + kWidth, py(e)}}, "#ddd", 1, svg);
      text(left_ - 22, py(e) + 4, label(e), "#333", svg);
    }
    for (const Series& series : kSeries) {
      std::vector<std::pair<double, double>> points;
      for (const auto& row : rows_) {
        points.emplace_back(px(std::log10(std::stod(row[x_]))),
                            py(std::log10(std::stod(row[series.column]))));
        *svg << "<circle cx=\"" << points.back().first << "\" cy=\"" << points.back().second
             << "\" r=\"3.5\" fill=\"" << series.colour << "\"/>\n";
      }
      line(points, series.colour, 2, svg);
      text(points.front().first + 40, points.front().second + series.name_y, series.name,
           series.colour, svg);
    }
  }

 private:
  using Range = std::pair<double, double>;  // whole powers of ten

  static void grow(double value, Range* range) {
    range->first = std::min(range->first, std::floor(std::log10(value)));
    range->second = std::max(range->second, std::ceil(std::log10(value) - 0.01));
  }
  double px(double e) const {
    return left_ + kWidth * (e - x_range_.first) / (x_range_.second - x_range_.first);
  }
  double py(double e) const {
    return kTop + kHeight * (y_range_.second - e) / (y_range_.second - y_range_.first);
  }
  static std::string label(double e) { return benchmark::text("%g", std::pow(10.0, e)); }
  static void text(double x, double y, const std::string& words, const std::string& colour,
                   std::ostream* svg) {
    *svg << "<text x=\"" << x << "\" y=\"" << y << "\" text-anchor=\"middle\" fill=\"" << colour
         << "\">" << words << "</text>\n";
  }
  static void line(const std::vector<std::pair<double, double>>& points, const std::string& colour,
                   double width, std::ostream* svg) {
    *svg << "<polyline fill=\"none\" stroke=\"" << colour << "\" stroke-width=\"" << width
         << "\" points=\"";
    for (const auto& [x, y] : points) *svg << x << ',' << y << ' ';
    *svg << "\"/>\n";
  }

  double left_;
  std::size_t x_;  // column
  test::TableRows rows_;
  Range x_range_{1e9, -1e9}, y_range_{1e9, -1e9};
};

}  // namespace

void plot_growth(const std::string& document, const std::string& path) {
  const test::TableRows rows = test::parse_table(test::read_text(document), "growth");
  std::ostringstream svg;
  svg << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 " << 2 * kPanel << ' '
      << kTop + kHeight + 50 << "\" font-family=\"sans-serif\" font-size=\"12\">\n"
      << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
  Panel(0.0, rows, 1, "1000").draw("1000 spheres", "triangles", &svg);
  Panel(kPanel, rows, 0, "9940").draw("9940 triangles", "spheres", &svg);
  svg << "</svg>\n";
  std::ofstream(path) << svg.str();
}

}  // namespace ist::benchmark
