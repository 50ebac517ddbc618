#include <algorithm>
#include <limits>
#include <vector>

#include "ist_proximity/repulsion/repulsion.h"

namespace ist {
namespace {

BallGroup group_of(const Ball* balls, std::size_t count) {
  BallGroup group;
  Eigen::AlignedBox3d box;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kBallWidth); ++k) {
    const bool used = k < count;
    if (used) box.extend(balls[k].center);
    group.x[k] = used ? static_cast<float>(balls[k].center.x()) : kFarAway;
    group.y[k] = used ? static_cast<float>(balls[k].center.y()) : kFarAway;
    group.z[k] = used ? static_cast<float>(balls[k].center.z()) : kFarAway;
    group.radius[k] = used ? static_cast<float>(balls[k].radius) : 0.0F;
  }
  double reach = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    reach = std::max(reach, (balls[k].center - box.center()).norm() + balls[k].radius);
  }
  constexpr double kRounding = 1e-5;  // [m] of float coordinates, and more
  group.reach = static_cast<float>(reach + kRounding);
  for (int i = 0; i < 3; ++i) group.center[i] = static_cast<float>(box.center()[i]);
  return group;
}

// Halves across the longest side, whole groups to the left, until each is one group.
void split(Ball* begin, Ball* end, std::vector<BallGroup>* groups) {
  const auto count = static_cast<std::size_t>(end - begin);
  constexpr auto kWidth = static_cast<std::size_t>(kBallWidth);
  if (count <= kWidth) {
    if (count > 0) groups->push_back(group_of(begin, count));
    return;
  }
  Eigen::AlignedBox3d box;
  for (const Ball* ball = begin; ball != end; ++ball) box.extend(ball->center);
  Eigen::Index axis;
  box.sizes().maxCoeff(&axis);
  Ball* middle = begin + (count / 2 + kWidth - 1) / kWidth * kWidth;
  std::nth_element(begin, middle, end, [axis](const Ball& a, const Ball& b) {
    return a.center[axis] < b.center[axis];
  });
  split(begin, middle, groups);
  split(middle, end, groups);
}

}  // namespace

std::vector<BallGroup> group_balls(std::vector<Ball> balls) {
  std::vector<BallGroup> groups;
  split(balls.data(), balls.data() + balls.size(), &groups);
  return groups;
}

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
