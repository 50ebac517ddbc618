#include "internal/geometry/surface_bvh.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "geometry/solid_element.h"
#include "internal/geometry/float_rounding.h"
#include "internal/geometry/numbers.h"

namespace ist {
namespace {

using Kind = ConvexPart::Kind;

// Dividing a node of so many parts takes some milliseconds.
constexpr std::uint32_t kAskFrom = 4096;
// The children of nodes of so many levels have hulls of at most so many points, where they hold so
// many triangles; or a round part, which takes more points.
constexpr int kHullLevels = 3;
constexpr std::size_t kHullPoints = 64, kRoundHullPoints = 512;
constexpr std::uint32_t kHullParts = 16;

Eigen::Vector3d center_of(const ConvexPart& part) {
  return part.kind == Kind::kTriangle ? Eigen::Vector3d((part.a + part.b + part.c) / 3.0) : part.a;
}

void append_triangles(const TriangleBvh& bvh, const Eigen::Isometry3d& X_LE,
                      std::vector<ConvexPart>* parts) {
  for (std::uint32_t slot = 0; slot < bvh.size(); ++slot) {
    const TriangleBvh::Triangle& t = bvh.triangle(slot);
    parts->push_back({Kind::kTriangle, X_LE * t.a, X_LE * t.b, X_LE * t.c, 0.0, 0});
  }
}

std::vector<ConvexPart> parts_of(const Solid& solid) {
  std::vector<ConvexPart> parts;
  for (const SolidElement& element : elements_of(solid)) {
    const Eigen::Vector3d center = element.X_LE.translation();
    if (element.is_mesh()) {
      append_triangles(element.bvh, element.X_LE, &parts);
    } else if (const auto* sphere = std::get_if<Sphere>(&element.primitive)) {
      parts.push_back({Kind::kSphere, center, center, center, sphere->radius, 0});
    } else if (const auto* cylinder = std::get_if<Cylinder>(&element.primitive)) {
      const Eigen::Vector3d half = 0.5 * cylinder->length * element.X_LE.linear().col(2);
      parts.push_back({Kind::kCylinder, center, half, center, cylinder->radius, 0});
    } else {
      append_triangles(element.box_sides, element.X_LE, &parts);
    }
  }
  return parts;
}

// The axes u, v, n about a direction n: v is across it and across a second one.
Eigen::Matrix3d frame_about(const Eigen::Vector3d& n, const Eigen::Vector3d& along) {
  Eigen::Matrix3d frame;
  frame.col(2) = n.normalized();
  Eigen::Vector3d u = along - along.dot(frame.col(2)) * frame.col(2);
  if (!(u.norm() > 1e-6 * along.norm())) u = frame.col(2).unitOrthogonal();
  frame.col(0) = u.normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

// A frame that suits a single part: a triangle lies flat in it.
Eigen::Matrix3d frame_of(const ConvexPart& part) {
  if (part.kind == Kind::kSphere) return Eigen::Matrix3d::Identity();
  if (part.kind == Kind::kCylinder) {
    return part.b.norm() > 0.0 ? frame_about(part.b, Eigen::Vector3d::UnitX())
                               : Eigen::Matrix3d::Identity();
  }
  const Eigen::Vector3d edges[3] = {part.b - part.a, part.c - part.b, part.a - part.c};
  const Eigen::Vector3d* longest = &edges[0];
  for (const Eigen::Vector3d& edge : edges) {
    if (edge.squaredNorm() > longest->squaredNorm()) longest = &edge;
  }
  if (!(longest->norm() > 0.0)) return Eigen::Matrix3d::Identity();
  const Eigen::Vector3d n = edges[0].cross(edges[1]);
  return frame_about(n.norm() > 1e-12 * longest->squaredNorm() ? n : longest->unitOrthogonal(),
                     *longest);
}

// Sums over parts that describe how they lie.
struct Spread {
  double area = 0.0;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero(), mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d square = Eigen::Matrix3d::Zero();

  void add(const Eigen::Vector3d& p, double weight) {
    area += weight;
    mean += weight * p;
    square += weight * p * p.transpose();
  }
  // Principal axes.
  Eigen::Matrix3d axes() const {
    if (!(area > 0.0)) return Eigen::Matrix3d::Identity();
    const Eigen::Vector3d center = mean / area;
    const Eigen::Matrix3d covariance = square / area - center * center.transpose();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
    const Eigen::Matrix3d& axes = solver.eigenvectors();
    return axes.allFinite() ? axes : Eigen::Matrix3d(Eigen::Matrix3d::Identity());
  }
};

Spread spread_of(const std::vector<ConvexPart>& parts, std::uint32_t first, std::uint32_t last,
                 const Eigen::Vector3d& origin) {
  Spread spread;
  for (std::uint32_t i = first; i < last; ++i) {
    const ConvexPart& part = parts[i];
    if (part.kind == Kind::kTriangle) {
      const Eigen::Vector3d n = 0.5 * (part.b - part.a).cross(part.c - part.a);
      spread.normal += n;
      for (const Eigen::Vector3d& p : {part.a, part.b, part.c}) {
        spread.add(p - origin, n.norm() / 3.0);
      }
      continue;
    }
    const double size =
        part.radius * (part.radius + (part.kind == Kind::kCylinder ? part.b.norm() : 0.0));
    const Eigen::Vector3d along =
        part.kind == Kind::kCylinder ? part.b : Eigen::Vector3d(Eigen::Vector3d::Zero());
    for (const double sign : {-1.0, 1.0}) spread.add(part.a + sign * along - origin, size);
  }
  return spread;
}

struct Fit {
  Eigen::Matrix3d axes;
  Eigen::Vector3d center, half;
  double area = std::numeric_limits<double>::infinity();
};

// The smallest box with these axes that float can state.
Fit fit(const std::vector<ConvexPart>& parts, std::uint32_t first, std::uint32_t last,
        const Eigen::Matrix3d& axes) {
  Fit result;
  result.axes = axes.cast<float>().cast<double>();
  Eigen::Vector3d low = Eigen::Vector3d::Constant(kInfinity), high = -low;
  for (std::uint32_t i = first; i < last; ++i) {
    const ConvexPart& part = parts[i];
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d n = result.axes.col(axis);
      if (part.kind == Kind::kTriangle) {
        const double a = n.dot(part.a), b = n.dot(part.b), c = n.dot(part.c);
        low[axis] = std::min(low[axis], std::min({a, b, c}));
        high[axis] = std::max(high[axis], std::max({a, b, c}));
      } else {
        // The axes are of unit length but for rounding, which a sphere's radius has to bear.
        const double length = 1.0 + 1e-6;
        low[axis] =
            std::min(low[axis], n.dot(part.a) - length * (support(part, -n) + n.dot(part.a)));
        high[axis] =
            std::max(high[axis], n.dot(part.a) + length * (support(part, n) - n.dot(part.a)));
      }
    }
  }
  // The inverse, since rounded axes are not quite perpendicular.
  const Eigen::Vector3d middle = result.axes.transpose().inverse() * (0.5 * (low + high));
  result.center = middle.cast<float>().cast<double>();
  const Eigen::Vector3d at = result.axes.transpose() * result.center;
  result.half = (high - at).cwiseMax(at - low).cwiseMax(0.0);
  result.area = result.half.x() * result.half.y() + result.half.y() * result.half.z() +
                result.half.z() * result.half.x();
  return result;
}

}  // namespace

SurfaceBvh::SurfaceBvh(const Solid& solid, const CancelRequest& cancelled)
    : parts_(parts_of(solid)), hull_(parts_, cancelled), has_hulls_(true) {
  build(cancelled);
}

SurfaceBvh::SurfaceBvh(std::vector<ConvexPart> parts, const CancelRequest& cancelled)
    : parts_(std::move(parts)) {
  build(cancelled);
}

void SurfaceBvh::build(const CancelRequest& cancelled) {
  throw_if(cancelled);
  if (parts_.empty()) return;
  for (const ConvexPart& part : parts_) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d n = Eigen::Vector3d::Unit(axis);
      Eigen::Vector3d p = Eigen::Vector3d::Zero();
      p = bounds_.isEmpty() ? part.a : bounds_.center();
      p[axis] = ist::support(part, n);
      bounds_.extend(p);
      p[axis] = -ist::support(part, -n);
      bounds_.extend(p);
    }
  }
  extent_ = bounds_.min().cwiseAbs().cwiseMax(bounds_.max().cwiseAbs()).norm();
  nodes_.emplace_back();
  Node root{};
  const Range all{0, static_cast<std::uint32_t>(parts_.size())};
  set_box(all, &root, 0);
  for (int slot = 1; slot < kWidth; ++slot) {
    throw_if(cancelled);
    set_box(all, &root, slot);
  }
  throw_if(cancelled);
  root.count = 1;
  root.child[0] = parts_.size() == 1 ? ~0 : add_node(all, 1, cancelled);
  nodes_[0] = root;
}

namespace {

// Halves a range at the median of the parts' centres along the axis in which they spread most.
std::uint32_t halve(std::vector<ConvexPart>* parts, std::uint32_t first, std::uint32_t last) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::uint32_t i = first; i < last; ++i) mean += center_of((*parts)[i]);
  mean /= last - first;
  Spread spread;
  for (std::uint32_t i = first; i < last; ++i) spread.add(center_of((*parts)[i]) - mean, 1.0);
  const Eigen::Vector3d axis = spread.axes().col(2);
  const std::uint32_t middle = first + (last - first) / 2;
  std::nth_element(parts->begin() + first, parts->begin() + middle, parts->begin() + last,
                   [&](const ConvexPart& p, const ConvexPart& q) {
                     return axis.dot(center_of(p)) < axis.dot(center_of(q));
                   });
  return middle;
}

}  // namespace

// A hull of a part of a surface: where the surface is not convex, its parts often are nearly so.
void SurfaceBvh::add_hull(const Range& range, Slot slot, const CancelRequest& cancelled) {
  const Span<const ConvexPart> parts(&parts_[range.first], range.second - range.first);
  const bool has_round = std::any_of(parts.begin(), parts.end(), [](const ConvexPart& part) {
    return part.kind != Kind::kTriangle;
  });
  if (!has_round && parts.size() < kHullParts) return;
  if (hull_of_.size() <= slot) hull_of_.resize(slot + 1, -1);
  hull_of_[slot] = static_cast<std::int32_t>(hulls_.size());
  hulls_.emplace_back(parts, cancelled, has_round ? kRoundHullPoints : kHullPoints);
}

std::int32_t SurfaceBvh::add_node(const Range& range, int depth, const CancelRequest& cancelled) {
  const std::size_t index = nodes_.size();
  nodes_.emplace_back();
  std::vector<Range> groups{range};
  for (int level = 0; level < 3; ++level) {
    std::vector<Range> halves;
    for (const Range& group : groups) {
      if (group.second - group.first == 1) {
        halves.push_back(group);
        continue;
      }
      if (group.second - group.first >= kAskFrom) throw_if(cancelled);
      const std::uint32_t middle = halve(&parts_, group.first, group.second);
      halves.push_back({group.first, middle});
      halves.push_back({middle, group.second});
    }
    groups = std::move(halves);
  }
  Node node{};
  node.count = static_cast<std::int32_t>(groups.size());
  for (int slot = 0; slot < kWidth; ++slot) {
    const bool used = slot < node.count;
    const Range& group = groups[used ? static_cast<std::size_t>(slot) : 0];
    if (group.second - group.first >= kAskFrom) throw_if(cancelled);
    set_box(group, &node, slot);
    if (!used) continue;
    const bool is_part = group.second - group.first == 1;
    if (has_hulls_ && depth <= kHullLevels) {
      add_hull(group, static_cast<Slot>(kWidth * index) + static_cast<Slot>(slot), cancelled);
    }
    node.child[slot] =
        is_part ? ~static_cast<std::int32_t>(group.first) : add_node(group, depth + 1, cancelled);
  }
  nodes_[index] = node;
  return static_cast<std::int32_t>(index);
}

void SurfaceBvh::set_box(const Range& range, Node* node, int slot) const {
  const std::uint32_t first = range.first, last = range.second;  // a lambda captures no binding
  Fit best;
  const auto attempt = [&](const Eigen::Matrix3d& axes) {
    const Fit candidate = fit(parts_, first, last, axes);
    if (candidate.area < best.area) best = candidate;
  };
  if (last - first == 1) {
    best = fit(parts_, first, last, frame_of(parts_[first]));
  } else {
    const Spread spread = spread_of(parts_, first, last, center_of(parts_[first]));
    const Eigen::Matrix3d principal = spread.axes();
    attempt(Eigen::Matrix3d::Identity());
    attempt(principal);
    if (spread.normal.norm() > 1e-6 * spread.area && spread.area > 0.0) {
      attempt(frame_about(spread.normal, principal.col(2)));
    }
    attempt(frame_of(parts_[first]));
  }
  for (int k = 0; k < 3; ++k) {
    node->center[k][slot] = static_cast<float>(best.center[k]);
    node->half[k][slot] = round_up(best.half[k] * (1.0 + 1e-12));
    for (int i = 0; i < 3; ++i) {
      node->axis[i][k][slot] = static_cast<float>(best.axes(k, i));
    }
  }
  node->radius[slot] = round_up(best.half.norm() * (1.0 + 1e-6));
}

namespace {

struct BoundedChild {
  double bound;  // [m]
  std::int32_t child;
  SurfaceBvh::Slot slot;
};

}  // namespace

// Branch and bound: float decides which parts are measured in double.
double SurfaceBvh::support(const Eigen::Vector3d& n_L) const {
  if (parts_.empty()) return -kInfinity;
  const double rounding = 2e-6 * extent_;
  const Eigen::Vector3f n = n_L.cast<float>();
  TraversalStack<BoundedChild, stack_capacity(kMaxLevels, kWidth)> stack;
  stack.push({kInfinity, nodes_[0].child[0], kRoot});
  double largest = hull_.empty() ? -kInfinity : n_L.dot(hull_.point(hull_.farthest(n_L)));
  while (!stack.empty()) {
    const BoundedChild entry = stack.pop();
    if (entry.bound <= largest) continue;
    if (entry.child < 0) {
      const ConvexPart& part = parts_[static_cast<std::size_t>(~entry.child)];
      largest = std::max(largest, ist::support(part, n_L));
      continue;
    }
    const Node& node = nodes_[static_cast<std::size_t>(entry.child)];
    alignas(32) float supports[kWidth];
    oriented_box_supports(node, n.data(), supports);
    const std::size_t first = stack.size();
    for (int k = 0; k < node.count; ++k) {
      const double bound = static_cast<double>(supports[k]) + rounding;
      if (bound > largest) {
        stack.push_greatest_on_top<&BoundedChild::bound>(first, {bound, node.child[k], 0});
      }
    }
  }
  return largest;
}

// Depth first, the nearest box first.
SurfaceBvh::Slot SurfaceBvh::nearest_part(const Eigen::Vector3d& p_L, double enough) const {
  const double rounding = 2e-6 * (extent_ + p_L.norm());
  const ConvexPart point{Kind::kSphere, p_L, p_L, p_L, 0.0, 0};
  OrientedBox box{};
  Eigen::Map<Eigen::Vector3f>(box.center) = p_L.cast<float>();
  for (int i = 0; i < 3; ++i) box.axis[i][i] = 1.0F;
  TraversalStack<BoundedChild, stack_capacity(kMaxLevels, kWidth)> stack;
  stack.push({-1.0, nodes_[0].child[0], kRoot});
  double least = std::numeric_limits<double>::infinity();
  Slot nearest = kRoot;
  while (!stack.empty() && least > enough) {
    const BoundedChild entry = stack.pop();
    if (entry.bound >= least) continue;
    if (entry.child < 0) {
      const ConvexPart& part = parts_[static_cast<std::size_t>(~entry.child)];
      const double distance = convex_distance(point, part).distance;
      if (!(distance < least)) continue;
      least = distance;
      nearest = entry.slot;
      continue;
    }
    const Node& node = nodes_[static_cast<std::size_t>(entry.child)];
    alignas(32) float bounds[kWidth];
    oriented_box_bounds(node, box, bounds);
    const std::size_t first = stack.size();
    const auto slots = static_cast<Slot>(entry.child) * kWidth;
    for (int k = 0; k < node.count; ++k) {
      const double bound = static_cast<double>(bounds[k]) - rounding;
      if (bound >= least) continue;
      stack.push_least_on_top<&BoundedChild::bound>(
          first, {bound, node.child[k], slots + static_cast<Slot>(k)});
    }
  }
  return nearest;
}

}  // namespace ist
