#include "internal/geometry/hull_coreset.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/hull_distance.h"

namespace ist {
namespace {

// Points of a coreset, at most: of a large mesh fewer, since each costs a look at all corners
// (about this many in all).
constexpr std::size_t kMaxPoints = 2048, kMinPoints = 128, kMaxLooks = 40000000;
// Errors that are aimed at one after the other, as shares of the size, while there are points left.
constexpr double kErrors[] = {0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4, 1e-9};
// Float's error in a sum of three products: the point that is chosen may be this share of its
// coordinates less far than the farthest.
constexpr double kFloatRounding = 1e-6;
constexpr int kMaxSteps = 40;

std::vector<Eigen::Vector3d> corners_of(const std::vector<ConvexPart>& parts) {
  std::vector<Eigen::Vector3d> corners;
  corners.reserve(3 * parts.size());
  for (const ConvexPart& part : parts) {
    if (part.kind != ConvexPart::Kind::kTriangle) return {};
    for (const Eigen::Vector3d& corner : {part.a, part.b, part.c}) corners.push_back(corner);
  }
  const auto place = [](const Eigen::Vector3d& p) { return std::make_tuple(p.x(), p.y(), p.z()); };
  std::sort(corners.begin(), corners.end(),
            [&](const auto& p, const auto& q) { return place(p) < place(q); });
  corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
  return corners;
}

}  // namespace

// Adds the corner that is farthest outside, until all are near enough.
class HullCoreset::Builder {
 public:
  Builder(std::vector<Eigen::Vector3d> corners, HullCoreset* set)
      : corners_(std::move(corners)),
        distances_(corners_.size(), std::numeric_limits<double>::infinity()),
        set_(*set),
        max_points_(std::clamp(kMaxLooks / corners_.size(), kMinPoints, kMaxPoints)) {
    Eigen::AlignedBox3d box;
    for (const Eigen::Vector3d& p : corners_) {
      box.extend(p);
      extent_ = std::max(extent_, p.norm());
    }
    size_ = box.sizes().norm();
  }

  void run(const CancelRequest& cancelled) {
    set_.add(corners_.front());
    for (int x = -1; x <= 1; ++x) {
      for (int y = -1; y <= 1; ++y) {
        for (int z = -1; z <= 1; ++z) add_farthest({1.0 * x, 1.0 * y, 1.0 * z});
      }
    }
    for (const double share : kErrors) improve_to(share * size_, cancelled);
    double error = 0.0;
    for (const double distance : distances_) error = std::max(error, distance);
    // A point of the hull is at most the largest of its corners' distances from the coreset's hull.
    set_.error_ = error + (kFloatRounding + kLostInLength) * extent_;
  }

 private:
  void improve_to(double error, const CancelRequest& cancelled) {
    constexpr std::size_t kAskEvery = 256;
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      if (i % kAskEvery == 0) throw_if(cancelled);
      while (distances_[i] > error) {
        const Eigen::Vector3d outward = measure(i);
        if (!(distances_[i] > error) || set_.size() >= max_points_) break;
        if (!add_farthest(outward)) break;
      }
    }
  }

  // A full coreset takes no more points. @returns whether the point was a new one
  bool add_farthest(const Eigen::Vector3d& n) {
    const auto farthest =
        std::max_element(corners_.begin(), corners_.end(),
                         [&](const auto& p, const auto& q) { return n.dot(p) < n.dot(q); });
    const auto& points = set_.points_;
    if (std::find(points.begin(), points.end(), *farthest) != points.end()) return false;
    set_.add(*farthest);
    return true;
  }

  // The distance of a corner to the coreset's hull, or more. @returns the direction out of the hull
  Eigen::Vector3d measure(std::size_t i) {
    Eigen::Vector3d off = set_.offset(corners_[i], &last_);
    distances_[i] = std::min(distances_[i], off.norm() + kLostInLength * extent_);
    return off;
  }

  const std::vector<Eigen::Vector3d> corners_;
  std::vector<double> distances_;  // [m] of each corner to the coreset's hull, at most
  HullCoreset& set_;
  const std::size_t max_points_;
  double extent_ = 0.0, size_ = 0.0;  // [m] from the origin, and across
  std::uint32_t last_ = 0;
};

HullCoreset::HullCoreset(const std::vector<ConvexPart>& parts, const CancelRequest& cancelled) {
  std::vector<Eigen::Vector3d> corners = corners_of(parts);
  if (corners.empty()) return;
  Builder(std::move(corners), this).run(cancelled);
}

// Finds the point of the coreset's hull that is nearest to p, by GJK from a point of the coreset
// on, which is replaced by one of the last ones. @returns [m] the vector from there to p
Eigen::Vector3d HullCoreset::offset(const Eigen::Vector3d& p, std::uint32_t* point_index) const {
  DifferenceSimplex simplex;
  const auto add_corner = [&](std::uint32_t b) {
    simplex.corner[simplex.size++] = {p - points_[b], p, points_[b], 0, b};
    simplex.reduce();
  };
  add_corner(*point_index);
  Eigen::Vector3d v = simplex.nearest();
  for (int step = 0; step < kMaxSteps && simplex.size < 4 && v.norm() > 0.0; ++step) {
    const std::uint32_t next = farthest(v);
    if (v.dot(p - points_[next]) >= (1.0 - 1e-6) * v.squaredNorm()) break;
    const DifferenceSimplex smaller = simplex;
    add_corner(next);
    if (simplex.size == 0 || !(simplex.nearest().squaredNorm() < v.squaredNorm())) {
      simplex = smaller;
      break;
    }
    v = simplex.nearest();
  }
  *point_index = simplex.corner[0].b;
  return v;
}

double HullCoreset::distance_at_most(const Eigen::Vector3d& p) const {
  std::uint32_t start = 0;
  return offset(p, &start).norm() * (1.0 + 1e-9) + kLostInLength * (p.norm() + points_[0].norm());
}

void HullCoreset::add(const Eigen::Vector3d& point) {
  points_.push_back(point);
  const std::size_t count = coreset_lanes(points_.size());
  lanes_.resize(3 * count);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < count; ++i) {
      const Eigen::Vector3d& p = points_[i < points_.size() ? i : 0];
      lanes_[axis * count + i] = static_cast<float>(p[static_cast<Eigen::Index>(axis)]);
    }
  }
}

std::uint32_t HullCoreset::farthest(const Eigen::Vector3d& n) const {
  const float direction[3] = {static_cast<float>(n.x()), static_cast<float>(n.y()),
                              static_cast<float>(n.z())};
  const std::size_t count = lanes_.size() / 3;
  const std::uint32_t index = farthest_of_lanes(lanes_.data(), count, direction);
  return index < points_.size() ? index : 0;
}

std::uint32_t HullCoreset::farthest_in_double(const Eigen::Vector3d& n) const {
  std::size_t best = 0;
  double largest = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < points_.size(); ++i) {
    const double along = n.dot(points_[i]);
    if (!(along > largest)) continue;
    largest = along;
    best = i;
  }
  return static_cast<std::uint32_t>(best);
}

}  // namespace ist
