#include "ros/output/label_layout.h"

#include <algorithm>
#include <cmath>

namespace ist {
namespace {

bool is_free(const std::vector<Label>& placed, double height, double row) {
  constexpr double kSlack = 1e-9;
  return std::all_of(placed.begin(), placed.end(), [&](const Label& other) {
    return std::abs(other.position.z() - height) >= row - kSlack;
  });
}

}  // namespace

std::vector<Label> place_labels(const std::vector<Label>& labels, double row, double farthest) {
  std::vector<Label> placed;
  for (Label label : labels) {
    // A free row that is nearest to the wanted one is the wanted one or touches a taken one.
    std::vector<double> heights = {label.position.z()};
    for (const Label& other : placed) {
      heights.push_back(other.position.z() + row);
      heights.push_back(other.position.z() - row);
    }
    const double wanted = label.position.z();
    std::stable_sort(heights.begin(), heights.end(), [wanted](double a, double b) {
      return std::abs(a - wanted) < std::abs(b - wanted);
    });
    for (const double height : heights) {
      if (!(std::abs(height - wanted) <= farthest)) break;
      if (!is_free(placed, height, row)) continue;
      label.position.z() = height;
      placed.push_back(label);
      break;
    }
  }
  return placed;
}

}  // namespace ist
