#include "clearance_ascent.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace ist {
namespace {

constexpr int kMaxAscents = 40;
constexpr std::size_t kContacts = 8;
constexpr double kLeastAscent = 0.01;  // share of the clearance
constexpr double kMinRise = 1e-3;      // share of the clearance; a smaller rise is none
constexpr double kMinSlope = 0.05;     // below it the point counts as a local maximum

// The nearest points of the obstacles met last; the oldest is overwritten first.
class Contacts {
 public:
  void add(const Eigen::Vector3d& contact) {
    points_[next_++ % kContacts] = contact;
    count_ = std::min(count_ + 1, kContacts);
  }

  // The steepest ascent of the clearance at x: the shortest vector in the convex hull of the unit
  // vectors from all contacts within `max_distance` to x (Gilbert's algorithm). A movement along it
  // increases the distance to each of them at a rate of at least its length.
  Eigen::Vector3d steepest_ascent(const Eigen::Vector3d& x, double max_distance) const {
    std::array<Eigen::Vector3d, kContacts> unit;
    std::size_t n = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Eigen::Vector3d v = x - points_[i];
      const double norm = v.norm();
      if (norm <= max_distance && norm > 0.0) unit[n++] = v / norm;
    }
    if (n == 0) return Eigen::Vector3d::Zero();
    Eigen::Vector3d shortest = unit[0];
    for (int step = 0; step < 12; ++step) {
      std::size_t support = 0;  // in the direction of -shortest
      for (std::size_t i = 1; i < n; ++i) {
        if (unit[i].dot(shortest) < unit[support].dot(shortest)) support = i;
      }
      const Eigen::Vector3d edge = unit[support] - shortest;
      const double length_sq = edge.squaredNorm();
      if (length_sq < 1e-12) break;
      const double share = std::clamp(-shortest.dot(edge) / length_sq, 0.0, 1.0);
      if (share <= 0.0) break;
      shortest += share * edge;
    }
    return shortest;
  }

 private:
  std::array<Eigen::Vector3d, kContacts> points_;
  std::size_t count_ = 0, next_ = 0;
};

}  // namespace

MedialSphere climb_clearance(const MedialSphereFinder& finder, const Eigen::Vector3d& x) {
  MedialSphereFinder::Obstacle obstacle = finder.nearest(x);
  MedialSphere sphere{x, obstacle.distance};
  Contacts contacts;
  contacts.add(obstacle.contact);
  double step = 0.5 * sphere.radius;
  for (int i = 0; i < kMaxAscents && step > kLeastAscent * sphere.radius; ++i) {
    const Eigen::Vector3d direction = contacts.steepest_ascent(sphere.center, sphere.radius + step);
    const double slope = direction.norm();
    if (slope < kMinSlope) {
      step *= 0.5;
      continue;
    }
    // A step shorter than the clearance crosses neither a triangle nor a hole.
    const Eigen::Vector3d next = sphere.center + step / slope * direction;
    obstacle = finder.nearest(next);
    contacts.add(obstacle.contact);
    if (obstacle.distance > (1.0 + kMinRise) * sphere.radius) {
      sphere = {next, obstacle.distance};
      step = std::min(1.5 * step, 0.9 * sphere.radius);
    } else {
      step *= 0.5;
    }
  }
  return sphere;
}

}  // namespace ist
