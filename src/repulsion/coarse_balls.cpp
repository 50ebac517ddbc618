#include <algorithm>
#include <limits>

#include "ist_proximity/repulsion/repulsion.h"

namespace ist {

std::vector<Ball> coarse_balls(const Packing& packing, std::size_t count) {
  const std::vector<Ball>& balls = packing.balls;
  std::vector<Ball> chosen;
  if (balls.empty()) return chosen;
  // How far each ball reaches beyond the chosen ones [m]; whole balls, in the bound's sense.
  std::vector<double> beyond(balls.size(), std::numeric_limits<double>::infinity());
  auto next = std::max_element(balls.begin(), balls.end(),
                               [](const Ball& a, const Ball& b) { return a.radius < b.radius; });
  while (chosen.size() < std::min(count, balls.size())) {
    chosen.push_back(*next);
    double farthest = 0.0;
    for (std::size_t i = 0; i < balls.size(); ++i) {
      const double reach = (balls[i].center - chosen.back().center).norm() + balls[i].radius;
      beyond[i] = std::min(beyond[i], reach - chosen.back().radius);
      if (beyond[i] > farthest) {
        farthest = beyond[i];
        next = balls.begin() + static_cast<std::ptrdiff_t>(i);
      }
    }
    if (farthest <= 0.0) break;  // the rest lies within
  }
  return chosen;
}

}  // namespace ist
