#include "internal/geometry/hull_coreset.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/hull_distance.h"

namespace ist {
namespace {

// A large mesh gets fewer points, since each costs a look at all corners (about this many in all).
constexpr std::size_t kMinPoints = 128, kMaxLooks = 40000000;
// Errors that are aimed at one after the other, as shares of the size, while there are points left.
constexpr double kErrors[] = {0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4, 1e-9};
// Float's error in a sum of three products: the point that is chosen may be this share of its
// coordinates less far than the farthest.
constexpr double kCoresetRounding = 1e-6;
constexpr int kMaxCoresetSteps = 40;

// Points about the rim of a cylinder's cap, and from pole to pole of a sphere.
constexpr int kRimPoints = 128, kMeridianPoints = 48;

// Points whose hull is that of the parts, but for an error of those that are round.
struct Corners {
  std::vector<Eigen::Vector3d> points;
  double error = 0.0;  // [m] no part protrudes farther from the hull of the points

  void add(const ConvexPart& part) {
    if (part.kind == ConvexPart::Kind::kTriangle) {
      points.insert(points.end(), {part.a, part.b, part.c});
    } else if (part.kind == ConvexPart::Kind::kCylinder) {
      add_cylinder(part);
    } else {
      add_sphere(part);
    }
  }

 private:
  // Points of two rims: between two of them the circle rises above their chord.
  void add_cylinder(const ConvexPart& cylinder) {
    const Eigen::Vector3d axis =
        cylinder.b.norm() > 0.0 ? cylinder.b.normalized() : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d u = axis.unitOrthogonal(), v = axis.cross(u);
    for (int i = 0; i < kRimPoints; ++i) {
      const double angle = 2.0 * M_PI * i / kRimPoints;
      const Eigen::Vector3d radial = cylinder.radius * (std::cos(angle) * u + std::sin(angle) * v);
      points.push_back(cylinder.a + cylinder.b + radial);
      points.push_back(cylinder.a - cylinder.b + radial);
    }
    note(cylinder.radius * (1.0 - std::cos(M_PI / kRimPoints)));
  }

  // Points of parallels. From any direction, half a step along its meridian and at most half a step
  // along the parallel there lead to a point, so that one is within a step of each direction.
  void add_sphere(const ConvexPart& sphere) {
    const double step = M_PI / kMeridianPoints;
    for (int i = 0; i <= kMeridianPoints; ++i) {
      const double polar = step * i;
      const int count =
          std::max(1, static_cast<int>(std::ceil(2.0 * kMeridianPoints * std::sin(polar))));
      for (int k = 0; k < count; ++k) {
        const double angle = 2.0 * M_PI * k / count;
        points.push_back(sphere.a +
                         sphere.radius * Eigen::Vector3d(std::sin(polar) * std::cos(angle),
                                                         std::sin(polar) * std::sin(angle),
                                                         std::cos(polar)));
      }
    }
    note(sphere.radius * (1.0 - std::cos(step)));
  }

  void note(double protrusion) { error = std::max(error, protrusion * (1.0 + 1e-9)); }
};

Corners corners_of(Span<const ConvexPart> parts) {
  Corners corners;
  corners.points.reserve(3 * parts.size());
  for (const ConvexPart& part : parts) corners.add(part);
  auto& points = corners.points;
  const auto place = [](const Eigen::Vector3d& p) { return std::make_tuple(p.x(), p.y(), p.z()); };
  std::sort(points.begin(), points.end(),
            [&](const auto& p, const auto& q) { return place(p) < place(q); });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  return corners;
}

}  // namespace

// Adds the corner that is farthest outside, until all are near enough.
class HullCoreset::Builder {
 public:
  Builder(std::vector<Eigen::Vector3d> corners, std::size_t max_points, HullCoreset* set)
      : corners_(std::move(corners)),
        distances_(corners_.size(), std::numeric_limits<double>::infinity()),
        set_(*set),
        max_points_(std::min(max_points, std::max(kMaxLooks / corners_.size(), kMinPoints))) {
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
    set_.error_ = error + (kCoresetRounding + kLostInLength) * extent_;
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

HullCoreset::HullCoreset(Span<const ConvexPart> parts, const CancelRequest& cancelled,
                         std::size_t max_points) {
  if (parts.size() == 1 && parts[0].kind == ConvexPart::Kind::kSphere) {
    take_sphere(parts[0]);
    return;
  }
  Corners corners = corners_of(parts);
  if (corners.points.empty()) return;
  Builder(std::move(corners.points), max_points, this).run(cancelled);
  error_ += corners.error;
}

// Takes the centre of a sphere, which is the same distance from the hull in all directions: slabs
// are as wide as in closed form.
void HullCoreset::take_sphere(const ConvexPart& sphere) {
  add(sphere.a);
  error_ = sphere.radius * (1.0 + 1e-15) + kLostInLength * (sphere.a.norm() + sphere.radius);
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
  for (int step = 0; step < kMaxCoresetSteps && simplex.size < 4 && v.norm() > 0.0; ++step) {
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
