// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/separating_planes.cpp"
#include "proximity/separating_planes.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "internal/geometry/float_rounding.h"
#include "internal/geometry/solid_queries.h"
#include "proximity/clipped_sphere-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace separating_planes {
namespace hn = hwy::HWY_NAMESPACE;
using dual_tree::BoxTag;

// A box that is no larger than so many times its bound is not divided: what it holds is not much
// farther.
constexpr float kFineEnough = 0.5F;
// Boxes that are bounded by new planes between two looks at the clock.
constexpr std::uint32_t kDeadlineInterval = 16;
// A height above a plane has at most six roundings of 2^-24 of the coordinates.
constexpr float kHeightError = 1e-6F;

struct Entry {
  float bound, size;  // [m] size: diagonal of the box
  std::int32_t child;
  std::int32_t node;
  std::int16_t slot;   // of the box in its node
  std::int8_t planes;  // that the bound is of
  bool has_own_plane;  // one was made for this box
  bool is_open;        // the bound is that of the tile's obstacles
};

struct IsFarther {
  bool operator()(const Entry& a, const Entry& b) const { return a.bound > b.bound; }
};

// The box with the least bound first.
template <class Bvh>
class Search {
 public:
  Search(const SeparationInput<Bvh>& input, SeparatingPlanes* planes)
      : in_(input), spheres_(*input.spheres), planes_(*planes), nodes_(input.bvh->nodes().data()) {}

  float Run(Deadline* deadline) {
    Divide(in_.bvh->root());
    int steps = 1;
    while (steps < in_.max_steps && size_ > 0) {
      const Entry& nearest = queue_[0];
      if (nearest.planes < planes_.count()) {
        if (deadline != nullptr && deadline->passed_now_and_then(kDeadlineInterval)) break;
        Raise();
        continue;
      }
      ++steps;
      if (nearest.size <= kFineEnough * nearest.bound ||
          (deadline != nullptr && deadline->passed_by(in_.late))) {
        break;
      }
      if (MayMakePlane(nearest)) {
        planes_.add(DirectionTo(nearest));
        queue_[0].has_own_plane = true;
        continue;
      }
      if (nearest.is_open) break;
      if (nearest.child < 0) {
        OpenTile();
      } else {
        Divide(Pop().child);
      }
    }
    return size_ > 0 ? std::min(queue_[0].bound, farthest_) : farthest_;
  }

 private:
  bool MayMakePlane(const Entry& entry) const {
    return !entry.has_own_plane && planes_.count() < in_.max_planes &&
           (entry.child < 0 || entry.size <= in_.radius);
  }

  // The direction from the centre of the sphere that is nearest to a box, to the box.
  Eigen::Vector3d DirectionTo(const Entry& entry) const {
    const BoxNode& node = nodes_[entry.node];
    const Eigen::AlignedBox3f box(
        Eigen::Vector3f(node.min_x[entry.slot], node.min_y[entry.slot], node.min_z[entry.slot]),
        Eigen::Vector3f(node.max_x[entry.slot], node.max_y[entry.slot], node.max_z[entry.slot]));
    float least = kFarAway;
    Eigen::Vector3f direction = Eigen::Vector3f::UnitX();
    for (int s = 0; s < spheres_.count; ++s) {
      const Eigen::Vector3f center(spheres_.x[s], spheres_.y[s], spheres_.z[s]);
      const float distance = box.exteriorDistance(center) - spheres_.radius[s];
      if (!(distance < least)) continue;
      least = distance;
      Eigen::Vector3f nearest = center.cwiseMax(box.min()).cwiseMin(box.max());
      if (nearest == center) nearest = box.center();
      if (nearest != center) direction = nearest - center;
    }
    return direction.cast<double>();
  }

  // The heights of sixteen points, or the least ones of sixteen boxes, above a plane, with their
  // rounding taken off.
  HWY_INLINE static hn::Vec<BoxTag> Height(const PointTile& tile, std::size_t k,
                                           const SeparatingPlanes::Plane& plane) {
    return Height(tile.x + k, tile.y + k, tile.z + k, plane);
  }
  template <class Boxes>
  HWY_INLINE static hn::Vec<BoxTag> Height(const Boxes& boxes, std::size_t k,
                                           const SeparatingPlanes::Plane& plane) {
    return Height((plane.normal[0] > 0.0F ? boxes.min_x : boxes.max_x) + k,
                  (plane.normal[1] > 0.0F ? boxes.min_y : boxes.max_y) + k,
                  (plane.normal[2] > 0.0F ? boxes.min_z : boxes.max_z) + k, plane);
  }
  HWY_INLINE static hn::Vec<BoxTag> Height(const float* px, const float* py, const float* pz,
                                           const SeparatingPlanes::Plane& plane) {
    const BoxTag d;
    const auto x = hn::Load(d, px), y = hn::Load(d, py), z = hn::Load(d, pz);
    const auto along = hn::MulAdd(
        hn::Set(d, plane.normal[0]), x,
        hn::MulAdd(hn::Set(d, plane.normal[1]), y, hn::Mul(hn::Set(d, plane.normal[2]), z)));
    const auto size = hn::Add(hn::Add(hn::Abs(x), hn::Abs(y)), hn::Abs(z));
    return hn::NegMulAdd(hn::Set(d, kHeightError), size, hn::Sub(along, hn::Set(d, plane.offset)));
  }
  float Height(const Entry& entry, const SeparatingPlanes::Plane& plane) const {
    const BoxNode& node = nodes_[entry.node];
    const int k = entry.slot;
    const float x = plane.normal[0] > 0.0F ? node.min_x[k] : node.max_x[k];
    const float y = plane.normal[1] > 0.0F ? node.min_y[k] : node.max_y[k];
    const float z = plane.normal[2] > 0.0F ? node.min_z[k] : node.max_z[k];
    const float along = plane.normal[0] * x + plane.normal[1] * y + plane.normal[2] * z;
    return along - plane.offset - kHeightError * (std::abs(x) + std::abs(y) + std::abs(z));
  }

  // Bounds the nearest box by the planes that were made since.
  void Raise() {
    Entry entry = Pop();
    if (entry.is_open) return PushOpen(entry);
    for (; entry.planes < planes_.count(); ++entry.planes) {
      entry.bound = std::max(entry.bound, Height(entry, planes_.plane(entry.planes)));
    }
    Push(entry);
  }

  // Looks at the obstacles of the nearest tile one by one.
  void OpenTile() {
    Entry entry = Pop();
    entry.is_open = true;
    PushOpen(entry);
  }
  void PushOpen(Entry entry) {
    typename Bvh::Tile scratch;
    const typename Bvh::Tile& tile =
        in_.bvh->tile(static_cast<std::size_t>(~entry.child), &scratch);
    alignas(64) float bound[kBoxWidth];
    Bound(tile, bound);
    entry.bound = std::max(entry.bound, *std::min_element(bound, bound + tile.count));
    entry.planes = static_cast<std::int8_t>(planes_.count());
    Push(entry);
  }

  // Bounds of sixteen obstacles or boxes. What is no farther from the spheres than the gap may be
  // inside: such a distance proves nothing. A height above a plane does.
  template <class Sixteen>
  void Bound(const Sixteen& sixteen, float* bound) const {
    const BoxTag d;
    const auto zero = hn::Zero(d), gap = hn::Set(d, in_.gap);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      auto least = hn::Set(d, kFarAway);
      for (int s = 0; s < spheres_.count; ++s) {
        const auto to_center =
            dual_tree::Distance(sixteen, k, spheres_.x[s], spheres_.y[s], spheres_.z[s]);
        least = hn::Min(least, hn::Sub(to_center, hn::Set(d, spheres_.radius[s])));
      }
      auto greatest = hn::IfThenElse(hn::Gt(least, gap), least, hn::Min(least, zero));
      for (int i = 0; i < planes_.count(); ++i) {
        greatest = hn::Max(greatest, Height(sixteen, k, planes_.plane(i)));
      }
      hn::Store(greatest, d, bound + k);
    }
  }

  void Divide(std::int32_t index) {
    const BoxNode& node = nodes_[index];
    const BoxTag d;
    alignas(64) float bound[kBoxWidth], size[kBoxWidth];
    Bound(node, bound);
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      hn::Store(dual_tree::Norm(hn::Sub(hn::Load(d, node.max_x + k), hn::Load(d, node.min_x + k)),
                                hn::Sub(hn::Load(d, node.max_y + k), hn::Load(d, node.min_y + k)),
                                hn::Sub(hn::Load(d, node.max_z + k), hn::Load(d, node.min_z + k))),
                d, size + k);
    }
    for (int k = 0; k < node.count; ++k) farthest_ = std::min(farthest_, bound[k] + size[k]);
    for (int k = 0; k < node.count; ++k) {
      if (bound[k] > farthest_) continue;
      Push({bound[k], size[k], node.child[k], index, static_cast<std::int16_t>(k),
            static_cast<std::int8_t>(planes_.count()), false, false});
    }
  }

  void Push(const Entry& entry) {
    queue_[size_++] = entry;
    std::push_heap(queue_.begin(), queue_.begin() + size_, IsFarther());
  }
  Entry Pop() {
    std::pop_heap(queue_.begin(), queue_.begin() + size_, IsFarther());
    return queue_[static_cast<std::size_t>(--size_)];
  }

  const SeparationInput<Bvh>& in_;
  const PosedSpheres& spheres_;
  SeparatingPlanes& planes_;
  const BoxNode* nodes_;
  float farthest_ = kFarAway;  // [m] nothing above it is looked at
  std::ptrdiff_t size_ = 0;
  // A step takes one entry and adds sixteen.
  std::array<Entry, 1 + kMaxSeparationSteps*(kBoxWidth - 1)> queue_;
};

}  // namespace separating_planes

float BoundPointsByPlanes(const SeparationInput<PointBvh>& input, SeparatingPlanes* planes,
                          Deadline* deadline) {
  return separating_planes::Search(input, planes).Run(deadline);
}

float BoundBoxesByPlanes(const SeparationInput<BoxBvh>& input, SeparatingPlanes* planes,
                         Deadline* deadline) {
  return separating_planes::Search(input, planes).Run(deadline);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {
namespace {

// [m] A support may be this much too large: it is found sooner.
constexpr double kSupportSlack = 1e-5;
// [m] Rounding of a support, for each metre that the link is large.
constexpr double kSupportRounding = 1e-12;

}  // namespace

HWY_EXPORT(BoundPointsByPlanes);
HWY_EXPORT(BoundBoxesByPlanes);

void SeparatingPlanes::add(const Eigen::Vector3d& direction_O) {
  if (count_ == kMax) return;
  const Eigen::Vector3d n_O = direction_O.normalized();
  const Eigen::Vector3d n_L = X_OL_.linear().transpose() * n_O;
  const InnerSphereTree& tree = link_.tree;
  const double least = n_L.dot(tree.center()) - tree.radius();
  const double offset = support(link_.solid, n_L, kSupportSlack, least) +
                        n_O.dot(X_OL_.translation()) +
                        kSupportRounding * (1.0 + tree.center().norm() + tree.radius());
  Plane& plane = planes_[static_cast<std::size_t>(count_++)];
  for (Eigen::Index i = 0; i < 3; ++i) {
    plane.normal[static_cast<std::size_t>(i)] = static_cast<float>(n_O[i]);
  }
  plane.offset = round_up(offset);
}

float bound_by_planes(const SeparationInput<PointBvh>& input, SeparatingPlanes* planes,
                      Deadline* deadline) {
  return HWY_DYNAMIC_DISPATCH(BoundPointsByPlanes)(input, planes, deadline);
}

float bound_by_planes(const SeparationInput<BoxBvh>& input, SeparatingPlanes* planes,
                      Deadline* deadline) {
  return HWY_DYNAMIC_DISPATCH(BoundBoxesByPlanes)(input, planes, deadline);
}

}  // namespace ist
#endif
