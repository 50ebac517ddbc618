#include "ist_proximity/repulsion/repulsion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace ist {
namespace {

// Sixteen numbers side by side; Eigen turns them into SIMD, square roots included.
using Lanes = Eigen::Array<float, kPointWidth, 1>;
using LaneMap = Eigen::Map<const Lanes, Eigen::Aligned16>;

// A ball in the frame of an index: its origin, and the axes of the fixed frame (points) or the map
// (boxes).
struct PlacedBall {
  float x, y, z, radius;  // [m]
};

// From each point of a tile, or from the nearest point of each box, to a ball.
struct ToBall {
  ToBall(const PointTile& tile, const PlacedBall& ball)
      : x(ball.x - LaneMap(tile.x)), y(ball.y - LaneMap(tile.y)), z(ball.z - LaneMap(tile.z)) {
    measure(ball);
  }
  ToBall(const BoxTile& tile, const PlacedBall& ball)
      : x(beyond(tile.min_x, tile.max_x, ball.x)),
        y(beyond(tile.min_y, tile.max_y, ball.y)),
        z(beyond(tile.min_z, tile.max_z, ball.z)) {
    measure(ball);
  }
  static Lanes beyond(const float* min, const float* max, float v) {
    return v - LaneMap(min).max(v).min(LaneMap(max));
  }
  void measure(const PlacedBall& ball) {
    length = (x * x + y * y + z * z).sqrt();
    distance = length - ball.radius;
  }
  Lanes x, y, z, length;  // [m] to the centre
  Lanes distance;         // [m] to the surface, negative inside
};

Lanes squared_distance(const BoxNode& node, const PlacedBall& ball) {
  const auto outside = [](const float* min, const float* max, float v) {
    return Lanes((LaneMap(min) - v).max(v - LaneMap(max)).max(0.0F));
  };
  const Lanes x = outside(node.min_x, node.max_x, ball.x);
  const Lanes y = outside(node.min_y, node.max_y, ball.y);
  const Lanes z = outside(node.min_z, node.max_z, ball.z);
  return x * x + y * y + z * z;
}

// Visits the tiles that may hold a point nearer to the ball's surface than `limit`, the nearest
// first. The limit may shrink meanwhile.
template <typename Index, typename Visit>
void visit_tiles(const Index& index, const PlacedBall& ball, const float& limit,
                 const Visit& visit) {
  if (index.empty()) return;
  const auto too_far = [&ball, &limit](float squared) {
    const float reach = std::max(limit + ball.radius, 0.0F);
    return !(squared < reach * reach);
  };
  struct Entry {
    std::int32_t child;
    float squared;
  };
  std::array<Entry, 160> stack;  // sixteen on each of the levels that 2^31 tiles can have
  std::size_t top = 0;
  stack[top++] = {index.root(), 0.0F};
  while (top > 0) {
    const Entry entry = stack[--top];
    if (too_far(entry.squared)) continue;
    if (entry.child < 0) {
      visit(index.tiles()[static_cast<std::size_t>(~entry.child)]);
      continue;
    }
    const BoxNode& node = index.nodes()[static_cast<std::size_t>(entry.child)];
    const Lanes squared = squared_distance(node, ball);
    const std::size_t begin = top;
    for (int k = 0; k < node.count; ++k) {
      if (too_far(squared[k])) continue;
      std::size_t at = top++;
      for (; at > begin && stack[at - 1].squared < squared[k]; --at) stack[at] = stack[at - 1];
      stack[at] = {node.child[k], squared[k]};
    }
  }
}

PlacedBall place(const Ball& ball, const Eigen::Isometry3d& X_OL) {
  const Eigen::Vector3f c = (X_OL * ball.center).cast<float>();
  return {c.x(), c.y(), c.z(), static_cast<float>(ball.radius)};
}

// Calls visit(index, ball, the same in the index's frame, R_FO) for each thinned cloud and each
// map, and each ball.
template <typename Visit>
void for_each_pair(const std::vector<const CloudSnapshot*>& clouds, const std::vector<Ball>& balls,
                   const Eigen::Isometry3d& X_FL, const Visit& visit) {
  for (const CloudSnapshot* cloud : clouds) {
    if (cloud == nullptr) continue;
    Eigen::Isometry3d X_FO = Eigen::Isometry3d::Identity();
    if (!cloud->coarse.empty()) {
      Eigen::Isometry3d X_OL = X_FL;
      X_OL.translation() -= cloud->coarse.origin();
      for (const Ball& ball : balls) visit(cloud->coarse, ball, place(ball, X_OL), X_FO.linear());
    }
    if (cloud->boxes == nullptr || cloud->boxes->empty()) continue;
    X_FO = cloud->X_FM * Eigen::Translation3d(cloud->boxes->origin());
    const Eigen::Isometry3d X_OL = X_FO.inverse() * X_FL;
    for (const Ball& ball : balls) visit(*cloud->boxes, ball, place(ball, X_OL), X_FO.linear());
  }
}

// The sums of all pairs, lane by lane.
struct Blend {
  Lanes x = Lanes::Zero(), y = Lanes::Zero(), z = Lanes::Zero();
  Lanes weight = Lanes::Zero();
  Lanes undirected = Lanes::Zero();  // the weight of points at a centre

  void add(const ToBall& pair, float nearest, float per_smoothing) {
    const Lanes w = (1.0F - (pair.distance - nearest) * per_smoothing).max(0.0F).square();
    // Shorter than this a direction is noise; the weight moves over to the fallback smoothly.
    constexpr float kTiny = 1e-6F;  // [m]
    const Lanes directed = w / pair.length.max(kTiny);
    x += directed * pair.x;
    y += directed * pair.y;
    z += directed * pair.z;
    weight += w;
    undirected += w * (1.0F - pair.length / kTiny).max(0.0F);
  }

  Eigen::Vector3d sum() const { return Eigen::Vector3f(x.sum(), y.sum(), z.sum()).cast<double>(); }
};

// Of all indices, in the fixed frame. A pair's line of action goes through its ball's centre, and
// so does that of the ball's sum.
struct Total {
  Eigen::Vector3d fallback;  // direction of what has none
  Push push;                 // times `weight`
  double weight = 0.0;

  // arm: from the link's origin to the ball's centre.
  void add(const Blend& blend, const Eigen::Matrix3d& R_FO, const Eigen::Vector3d& arm) {
    const Eigen::Vector3d sum =
        R_FO * blend.sum() + static_cast<double>(blend.undirected.sum()) * fallback;
    push.force += sum;
    push.torque += arm.cross(sum);
    weight += static_cast<double>(blend.weight.sum());
  }
};

Push scaled(const Push& push, double factor) { return {factor * push.force, factor * push.torque}; }

}  // namespace

Push Push::unknown() {
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  return {nan, nan};
}

double repulsion_strength(const LinkProximity& proximity, const RepulsionConfig& config) {
  if (proximity.state < LinkState::kNear) return 0.0;
  return std::clamp(1.0 - proximity.distance / config.influence_distance, 0.0, 1.0);
}

Repulsion::Repulsion(const std::shared_ptr<const RobotModel>& model) {
  coarse_.reserve(model->links.size());
  for (const LinkModel& link : model->links) {
    coarse_.push_back(coarse_balls(link.packing, kCoarseBalls));
  }
}

Push Repulsion::push(std::size_t link, const Eigen::Isometry3d& X_FL,
                     const std::vector<const CloudSnapshot*>& clouds,
                     const LinkProximity& proximity, const RepulsionConfig& config) const {
  if (proximity.state == LinkState::kUnknown) return Push::unknown();
  const double strength = repulsion_strength(proximity, config);
  if (!(strength > 0.0)) return {};

  const std::vector<Ball>& balls = coarse_[link];
  float nearest = std::numeric_limits<float>::infinity();
  for_each_pair(clouds, balls, X_FL,
                [&nearest](const auto& index, const Ball&, const PlacedBall& ball, const auto&) {
                  visit_tiles(index, ball, nearest, [&nearest, &ball](const auto& tile) {
                    nearest = std::min(nearest, ToBall(tile, ball).distance.minCoeff());
                  });
                });
  const double length = config.gain * strength;
  if (!std::isfinite(nearest)) {
    const Eigen::Vector3d arm = proximity.p_FL - X_FL.translation();
    return scaled({proximity.direction, arm.cross(proximity.direction)}, length);
  }
  Total total{proximity.direction, {}, 0.0};
  const auto smoothing = static_cast<float>(std::max(config.smoothing, 1e-6));
  const float limit = nearest + smoothing;
  for_each_pair(clouds, balls, X_FL,
                [&](const auto& index, const Ball& ball_L, const PlacedBall& ball,
                    const Eigen::Matrix3d& R_FO) {
                  Blend blend;
                  visit_tiles(index, ball, limit, [&](const auto& tile) {
                    blend.add(ToBall(tile, ball), nearest, 1.0F / smoothing);
                  });
                  total.add(blend, R_FO, X_FL.linear() * ball_L.center);
                });
  return scaled(total.push, length / total.weight);
}

}  // namespace ist
