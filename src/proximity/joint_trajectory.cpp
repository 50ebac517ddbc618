#include "ist_proximity/proximity/joint_trajectory.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "internal/geometry/numbers.h"

namespace ist {
namespace {

constexpr double kMostPieces = 64.0;

// A joint's polynomial between two waypoints, by its Bezier points.
struct Polynomial {
  std::array<double, 6> points{};
  std::size_t degree = 1;

  double at(double s) const {
    std::array<double, 6> p = points;
    for (std::size_t n = degree; n > 0; --n) {
      for (std::size_t i = 0; i < n; ++i) p[i] = (1.0 - s) * p[i] + s * p[i + 1];
    }
    return p[0];
  }
  // The largest second derivative for s from 0 to 1, or more; 0 for a joint without positions.
  double curvature() const {
    if (std::isnan(points[0])) return 0.0;
    double largest = 0.0;
    for (std::size_t i = 0; i + 2 <= degree; ++i) {
      const double one = std::abs(points[i + 2] - 2.0 * points[i + 1] + points[i]);
      largest = std::isnan(one) ? kInfinity : std::max(largest, one);  // inf - inf
    }
    return static_cast<double>(degree * (degree - 1)) * largest;
  }
};

Polynomial polynomial(const JointTrajectory& trajectory, std::size_t k, std::size_t joint) {
  const double span = trajectory.times[k + 1] - trajectory.times[k];
  const double p = trajectory.positions[k][joint], q = trajectory.positions[k + 1][joint];
  if (trajectory.velocities.empty()) return {{p, q}, 1};
  const double v = span * trajectory.velocities[k][joint];
  const double w = span * trajectory.velocities[k + 1][joint];
  if (trajectory.accelerations.empty()) return {{p, p + v / 3.0, q - w / 3.0, q}, 3};
  const double a = span * span * trajectory.accelerations[k][joint];
  const double b = span * span * trajectory.accelerations[k + 1][joint];
  return {
      {p, p + v / 5.0, p + 2.0 * v / 5.0 + a / 20.0, q - 2.0 * w / 5.0 + b / 20.0, q - w / 5.0, q},
      5};
}

}  // namespace

StraightPieces straight_pieces(const JointTrajectory& trajectory, double max_deviation) {
  StraightPieces pieces;
  std::vector<Polynomial> joints;
  for (std::size_t k = 0; k + 1 < trajectory.times.size(); ++k) {
    joints.clear();
    double curvature = 0.0;
    for (std::size_t j = 0; j < trajectory.positions[k].size(); ++j) {
      joints.push_back(polynomial(trajectory, k, j));
      curvature = std::max(curvature, joints.back().curvature());
    }
    const double wanted = std::ceil(std::sqrt(curvature / (8.0 * max_deviation)));
    const double count = std::clamp(wanted, 1.0, kMostPieces);
    const double begin = trajectory.times[k], span = trajectory.times[k + 1] - begin;
    for (double i = 0.0; i < count; ++i) {
      pieces.times.push_back(begin + span * i / count);
      std::vector<double> positions, deviations;
      for (std::size_t j = 0; j < joints.size(); ++j) {
        positions.push_back(i == 0.0 ? trajectory.positions[k][j] : joints[j].at(i / count));
        deviations.push_back(joints[j].curvature() / (8.0 * count * count));
      }
      pieces.positions.push_back(std::move(positions));
      pieces.deviations.push_back(std::move(deviations));
    }
  }
  if (!trajectory.times.empty()) {
    pieces.times.push_back(trajectory.times.back());
    pieces.positions.push_back(trajectory.positions.back());
  }
  return pieces;
}

std::vector<double> positions_at(const StraightPieces& pieces, double time) {
  const auto after = std::upper_bound(pieces.times.begin(), pieces.times.end(), time);
  if (after == pieces.times.begin()) return pieces.positions.front();
  if (after == pieces.times.end()) return pieces.positions.back();
  const auto k = static_cast<std::size_t>(std::distance(pieces.times.begin(), after));
  const double s = (time - pieces.times[k - 1]) / (pieces.times[k] - pieces.times[k - 1]);
  std::vector<double> q = pieces.positions[k - 1];
  for (std::size_t j = 0; j < q.size(); ++j) q[j] += s * (pieces.positions[k][j] - q[j]);
  return q;
}

double braking_way(const StraightPieces& pieces, double from, double until,
                   const std::vector<double>& decelerations) {
  double rate = kInfinity;  // [1/s] at which time can be slowed down
  for (std::size_t k = 0; k + 1 < pieces.times.size(); ++k) {
    if (pieces.times[k + 1] <= from || pieces.times[k] >= until) continue;
    const double span = pieces.times[k + 1] - pieces.times[k];
    for (std::size_t j = 0; j < pieces.deviations[k].size(); ++j) {
      // A polynomial is this far from its chord where its second derivative is that of the bound.
      const double acceleration = 8.0 * pieces.deviations[k][j] / (span * span);
      const double change = std::abs(pieces.positions[k + 1][j] - pieces.positions[k][j]);
      const double speed = change / span + 0.5 * acceleration * span;
      if (speed > 0.0) rate = std::min(rate, (decelerations[j] - acceleration) / speed);
    }
  }
  return rate > 0.0 ? 0.5 / rate : kInfinity;
}

}  // namespace ist
