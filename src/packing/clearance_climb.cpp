#include "clearance_climb.h"

#include <algorithm>
#include <array>
#include <cstddef>

namespace ist {
namespace {

constexpr int kMaxSteps = 40;
constexpr std::size_t kContacts = 8;
constexpr double kShortestStep = 0.01;  // of the clearance
constexpr double kLeastRise = 1e-3;     // of the clearance, to go on
constexpr double kFlat = 0.05;          // length of the common direction at a maximum

// The latest contacts, oldest overwritten first.
class Contacts {
 public:
  void add(const Eigen::Vector3d& contact) {
    points_[next_++ % kContacts] = contact;
    count_ = std::min(count_ + 1, kContacts);
  }

  // The shortest vector in the convex hull of the unit vectors to x from all contacts within
  // `reach`: moving along it leaves each of them by its length (Gilbert's algorithm).
  Eigen::Vector3d away(const Eigen::Vector3d& x, double reach) const {
    std::array<Eigen::Vector3d, kContacts> unit;
    std::size_t n = 0;
    for (std::size_t i = 0; i < count_; ++i) {
      const Eigen::Vector3d v = x - points_[i];
      const double norm = v.norm();
      if (norm <= reach && norm > 0.0) unit[n++] = v / norm;
    }
    if (n == 0) return Eigen::Vector3d::Zero();
    Eigen::Vector3d shortest = unit[0];
    for (int step = 0; step < 12; ++step) {
      std::size_t least = 0;
      for (std::size_t i = 1; i < n; ++i) {
        if (unit[i].dot(shortest) < unit[least].dot(shortest)) least = i;
      }
      const Eigen::Vector3d edge = unit[least] - shortest;
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

MedialSphereFinder::InnerSphere climb(const MedialSphereFinder& finder, const Eigen::Vector3d& x) {
  MedialSphereFinder::Obstacle obstacle = finder.nearest(x);
  MedialSphereFinder::InnerSphere sphere{x, obstacle.distance};
  Contacts contacts;
  contacts.add(obstacle.contact);
  double step = 0.5 * sphere.radius;
  for (int i = 0; i < kMaxSteps && step > kShortestStep * sphere.radius; ++i) {
    const Eigen::Vector3d direction = contacts.away(sphere.center, sphere.radius + step);
    const double slope = direction.norm();
    if (slope < kFlat) {
      step *= 0.5;
      continue;
    }
    // A step shorter than the clearance crosses no triangle, and leaves through no hole.
    const Eigen::Vector3d next = sphere.center + step / slope * direction;
    obstacle = finder.nearest(next);
    contacts.add(obstacle.contact);
    if (obstacle.distance > (1.0 + kLeastRise) * sphere.radius) {
      sphere = {next, obstacle.distance};
      step = std::min(1.5 * step, 0.9 * sphere.radius);
    } else {
      step *= 0.5;
    }
  }
  return sphere;
}

}  // namespace ist
