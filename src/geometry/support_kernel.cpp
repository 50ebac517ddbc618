// Support function of a TriangleBvh, or of its part within a sphere, by branch and bound. Compiled
// once per instruction set; the best one available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/support_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/child_support-inl.h"
#include "geometry/triangle_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace triangle_support {
namespace hn = hwy::HWY_NAMESPACE;
using triangle_bvh::FloatTag;

// Triangles with less height than this share of their length have no certain plane.
constexpr double kSliver = 1e-6;

// [m] An upper bound of n.x over the points x of a triangle that are in a sphere: the highest
// corner, or the highest point of the disc that the triangle's plane cuts out of the sphere. -inf
// where the plane misses the sphere.
inline double SupportInSphere(const TriangleBvh::Triangle& t, const SupportSphere& sphere,
                              const Eigen::Vector3d& n) {
  const Eigen::Vector3d a = t.a - sphere.center, b = t.b - sphere.center, c = t.c - sphere.center;
  const double center = n.dot(sphere.center);
  const double corners = std::max({n.dot(a), n.dot(b), n.dot(c)});
  const Eigen::Vector3d ab = b - a, ac = c - a, normal = ab.cross(ac);
  const double longest_sq = std::max({ab.squaredNorm(), ac.squaredNorm(), (c - b).squaredNorm()});
  const double area = normal.norm(), radius = sphere.radius;
  if (!(area > kSliver * longest_sq)) return center + corners;
  const double plane = normal.dot(a) / area;  // signed distance from the centre
  if (std::abs(plane) > radius) return -std::numeric_limits<double>::infinity();
  const double cosine = n.dot(normal) / area;
  const double sine = std::sqrt(std::max(0.0, (1.0 - cosine) * (1.0 + cosine)));
  return center +
         std::min(corners, plane * cosine + std::sqrt((radius - plane) * (radius + plane)) * sine);
}

// Bounds in float decide which nodes and leaves are visited; supports of triangles are in double.
class SupportSearch {
 public:
  SupportSearch(const TriangleBvh::View& bvh, const Eigen::Vector3d& n, const SupportSphere* sphere,
                double tolerance, double at_least)
      : bvh_(bvh),
        n_(n),
        sphere_(sphere),
        at_origin_(n.dot(bvh.origin)),
        // Float's error in a sum of three products.
        rounding_(1e-6 * n.norm() * bvh.radius),
        tolerance_(tolerance),
        largest_(at_least) {
    for (int axis = 0; axis < 3; ++axis) n_float_[axis] = static_cast<float>(n[axis]);
    if (sphere == nullptr) return;
    const Eigen::Vector3d center = sphere->center - bvh.origin;
    for (int axis = 0; axis < 3; ++axis) center_[axis] = static_cast<float>(center[axis]);
    const double radius = sphere->radius + 1e-6 * (center.norm() + bvh.radius + sphere->radius);
    radius_sq_ = static_cast<float>(1.000001 * radius * radius);
  }

  double Run() {
    TriangleBvh::Stack<Entry> stack;
    stack.push({0, std::numeric_limits<float>::infinity()});
    while (!stack.empty()) {
      const Entry entry = stack.pop();
      if (Prune(entry.support)) continue;
      if (entry.child < 0) {
        VisitLeaf(bvh_.leaves[~entry.child]);
        continue;
      }
      const TriangleBvh::Boxes& boxes = bvh_.boxes[entry.child];
      const TriangleBvh::Slabs& slabs = bvh_.slabs[entry.child];
      alignas(32) float support[TriangleBvh::kWidth];
      for (std::size_t k = 0; k < TriangleBvh::kWidth; k += hn::Lanes(FloatTag())) {
        hn::Store(WithinSphere(boxes, triangle_bvh::ChildSupport(boxes, slabs, n_float_, k), k),
                  FloatTag(), support + k);
      }
      const std::size_t first = stack.size();
      for (int k = 0; k < boxes.count; ++k) {
        if (Prune(support[k])) continue;
        stack.push_greatest_on_top<&Entry::support>(first, {boxes.child[k], support[k]});
      }
    }
    return std::max(largest_, largest_pruned_);
  }

 private:
  struct Entry {
    std::int32_t child;
    float support;  // [m] upper bound, from the origin
  };

  // The supports of those children that reach into the sphere; the others have none.
  HWY_INLINE hn::Vec<FloatTag> WithinSphere(const TriangleBvh::Boxes& boxes,
                                            hn::Vec<FloatTag> support, std::size_t k) const {
    if (sphere_ == nullptr) return support;
    const FloatTag d;
    auto distance_sq = hn::Zero(d);
    for (int axis = 0; axis < 3; ++axis) {
      const auto center = hn::Set(d, center_[axis]);
      const auto gap = hn::Max(hn::Max(hn::Sub(hn::Load(d, boxes.min[axis] + k), center),
                                       hn::Sub(center, hn::Load(d, boxes.max[axis] + k))),
                               hn::Zero(d));
      distance_sq = hn::MulAdd(gap, gap, distance_sq);
    }
    return hn::IfThenElse(hn::Le(distance_sq, hn::Set(d, radius_sq_)), support,
                          hn::Set(d, kOutside));
  }

  // Whether a part with this upper bound [m, from the origin] cannot raise the support by more than
  // the tolerance.
  bool Prune(float support) {
    if (support == kOutside) return true;
    const double upper_bound = static_cast<double>(support) + rounding_ + at_origin_;
    if (upper_bound > largest_ + tolerance_) return false;
    largest_pruned_ = std::max(largest_pruned_, upper_bound);
    return true;
  }

  void VisitLeaf(const TriangleBvh::Leaf& leaf) {
    const FloatTag d;
    const auto nx = hn::Set(d, n_float_[0]), ny = hn::Set(d, n_float_[1]),
               nz = hn::Set(d, n_float_[2]);
    auto support = hn::Set(d, std::numeric_limits<float>::lowest());
    for (std::size_t k = 0; k < TriangleBvh::kWidth; k += hn::Lanes(d)) {
      for (int row = 0; row < 9; row += 3) {
        const auto along =
            hn::MulAdd(nx, hn::Load(d, leaf.corner[row] + k),
                       hn::MulAdd(ny, hn::Load(d, leaf.corner[row + 1] + k),
                                  hn::Mul(nz, hn::Load(d, leaf.corner[row + 2] + k))));
        support = hn::Max(support, along);
      }
    }
    if (Prune(hn::GetLane(hn::MaxOfLanes(d, support)))) return;
    for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
      const TriangleBvh::Triangle t = bvh_.triangle(k);
      largest_ = sphere_ == nullptr ? std::max({largest_, n_.dot(t.a), n_.dot(t.b), n_.dot(t.c)})
                                    : std::max(largest_, SupportInSphere(t, *sphere_, n_));
    }
  }

  static constexpr float kOutside = std::numeric_limits<float>::lowest();

  const TriangleBvh::View& bvh_;
  const Eigen::Vector3d& n_;
  const SupportSphere* sphere_;  // null: the whole surface
  float n_float_[3];
  float center_[3] = {};    // [m] of the sphere, from the centre of the mesh's bounding box
  float radius_sq_ = 0.0F;  // [m^2] of the sphere, rounding included
  double at_origin_, rounding_, tolerance_;
  double largest_;  // [m] of all triangles visited
  double largest_pruned_ = -std::numeric_limits<double>::infinity();  // [m] of all upper bounds
};

}  // namespace triangle_support

double FindSupport(const TriangleBvh::View& bvh, const Eigen::Vector3d& n,
                   const SupportSphere* sphere, double tolerance, double at_least) {
  return triangle_support::SupportSearch(bvh, n, sphere, tolerance, at_least).Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindSupport);

double find_support(const TriangleBvh::View& bvh, const Eigen::Vector3d& n_M,
                    const SupportSphere* sphere, double tolerance, double at_least) {
  return HWY_DYNAMIC_DISPATCH(FindSupport)(bvh, n_M, sphere, tolerance, at_least);
}

}  // namespace ist
#endif
