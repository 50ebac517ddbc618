// Compiled once per instruction set; the best one that the machine has is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/first_bound.cpp"
#include "proximity/first_bound.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <array>

#include "proximity/clipped_sphere-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace first_bound {
namespace hn = hwy::HWY_NAMESPACE;
using dual_tree::BoxTag;

constexpr int kMaxSteps = 16;  // nodes that are divided
// A box that is no larger than so many times its bound is not divided: what it holds is not much
// farther.
constexpr float kFineEnough = 0.5F;

struct Entry {
  float bound, size;  // [m] size: diagonal of the box
  std::int32_t child;
};

struct IsFarther {
  bool operator()(const Entry& a, const Entry& b) const { return a.bound > b.bound; }
};

// Boxes that are to be divided, the one with the least bound first.
class Search {
 public:
  explicit Search(const PosedSpheres& spheres) : spheres_(spheres) {}

  float Run(const BoxNode* nodes, std::int32_t root, Deadline* deadline, double late) {
    Divide(nodes[root]);
    for (int step = 1; step < kMaxSteps && size_ > 0; ++step) {
      const Entry& nearest = queue_[0];
      if (nearest.child < 0 || nearest.size <= kFineEnough * nearest.bound) break;
      if (deadline != nullptr && deadline->passed_by(late)) break;
      Divide(nodes[Pop().child]);
    }
    return size_ > 0 ? std::min(queue_[0].bound, farthest_) : farthest_;
  }

 private:
  void Divide(const BoxNode& node) {
    const BoxTag d;
    alignas(64) float bound[kBoxWidth], size[kBoxWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kBoxWidth); k += hn::Lanes(d)) {
      auto least = hn::Set(d, kFarAway);
      for (int s = 0; s < spheres_.count; ++s) {
        const auto to_center =
            dual_tree::Distance(node, k, spheres_.x[s], spheres_.y[s], spheres_.z[s]);
        least = hn::Min(least, hn::Sub(to_center, hn::Set(d, spheres_.radius[s])));
      }
      hn::Store(least, d, bound + k);
      hn::Store(dual_tree::Norm(hn::Sub(hn::Load(d, node.max_x + k), hn::Load(d, node.min_x + k)),
                                hn::Sub(hn::Load(d, node.max_y + k), hn::Load(d, node.min_y + k)),
                                hn::Sub(hn::Load(d, node.max_z + k), hn::Load(d, node.min_z + k))),
                d, size + k);
    }
    for (int k = 0; k < node.count; ++k) farthest_ = std::min(farthest_, bound[k] + size[k]);
    for (int k = 0; k < node.count; ++k) {
      if (!(bound[k] > farthest_)) Push({bound[k], size[k], node.child[k]});
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

  const PosedSpheres& spheres_;
  float farthest_ = kFarAway;  // [m] some obstacle is no farther: every box holds one. What is
                               // farther is not pushed
  std::ptrdiff_t size_ = 0;
  // A step takes one entry and adds sixteen.
  std::array<Entry, 1 + kMaxSteps*(kBoxWidth - 1)> queue_;
};

}  // namespace first_bound

float FirstBound(const PosedSpheres& spheres, const BoxNode* nodes, std::int32_t root,
                 Deadline* deadline, double late) {
  return first_bound::Search(spheres).Run(nodes, root, deadline, late);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FirstBound);

PosedSpheres::PosedSpheres(const InnerSphereTree& tree, const Eigen::Isometry3d& X_OL,
                           bool is_fine) {
  const SphereNode& root = tree.nodes().front();
  for (int k = 0; k < root.count; ++k) {
    const std::int32_t child = root.child[k];
    if (!is_fine) {
      add(root, root.radius, k, X_OL);
    } else if (child >= 0) {
      const SphereNode& node = tree.nodes()[static_cast<std::size_t>(child)];
      for (int i = 0; i < node.count; ++i) add(node, node.radius, i, X_OL);
    } else {
      const SphereLeaf& leaf = tree.leaves()[static_cast<std::size_t>(~child)];
      for (int i = 0; i < leaf.count; ++i) add(leaf, leaf.cover_radius, i, X_OL);
    }
  }
}

template <class Spheres>
void PosedSpheres::add(const Spheres& spheres, const float* radii, int k,
                       const Eigen::Isometry3d& X_OL) {
  const Eigen::Vector3d center = X_OL * Eigen::Vector3d(spheres.x[k], spheres.y[k], spheres.z[k]);
  x[count] = static_cast<float>(center.x());
  y[count] = static_cast<float>(center.y());
  z[count] = static_cast<float>(center.z());
  radius[count++] = radii[k];
}

float first_bound(const PosedSpheres& spheres, const BoxNode* nodes, std::int32_t root,
                  Deadline* deadline, double late) {
  return HWY_DYNAMIC_DISPATCH(FirstBound)(spheres, nodes, root, deadline, late);
}

}  // namespace ist
#endif
