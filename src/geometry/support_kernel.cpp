// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/support_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "geometry/slab_reach-inl.h"
#include "geometry/triangle_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kSupportWidth = TriangleBvh::kWidth;
using SupportTag = hn::CappedTag<float, kSupportWidth>;

// Float tells which boxes and leaves can reach farthest, double how far.
class Farthest {
 public:
  Farthest(const TriangleBvh::View& tree, const Eigen::Vector3d& n, double slack, double reached)
      : tree_(tree),
        n_(n),
        at_origin_(n.dot(tree.origin)),
        // What float loses in a sum of three products.
        rounding_(1e-6 * n.norm() * tree.radius),
        slack_(slack),
        farthest_(reached) {
    for (int axis = 0; axis < 3; ++axis) n_float_[axis] = static_cast<float>(n[axis]);
  }

  double Run() {
    struct Entry {
      std::int32_t child;
      float reach;  // [m] of its box, from the origin
    };
    Entry stack[512];  // as in the search for the closest point
    std::size_t top = 0;
    stack[top++] = {0, std::numeric_limits<float>::infinity()};
    while (top > 0) {
      const Entry entry = stack[--top];
      if (LeftOut(entry.reach)) continue;
      if (entry.child < 0) {
        Visit(tree_.leaves[~entry.child]);
        continue;
      }
      const TriangleBvh::Boxes& boxes = tree_.boxes[entry.child];
      alignas(32) float reach[kSupportWidth];
      for (std::size_t k = 0; k < kSupportWidth; k += hn::Lanes(SupportTag())) {
        hn::Store(Reach(boxes, tree_.slabs[entry.child], n_float_, k), SupportTag(), reach + k);
      }
      const std::size_t begin = top;
      for (int k = 0; k < boxes.count; ++k) {
        if (LeftOut(reach[k])) continue;
        std::size_t at = top++;  // the farthest on top
        for (; at > begin && stack[at - 1].reach > reach[k]; --at) stack[at] = stack[at - 1];
        stack[at] = {boxes.child[k], reach[k]};
      }
    }
    return std::max(farthest_, left_out_);
  }

 private:
  // Whether what reaches this far does not matter, within the slack.
  bool LeftOut(float reach) {
    const double most = static_cast<double>(reach) + rounding_ + at_origin_;
    if (most > farthest_ + slack_) return false;
    left_out_ = std::max(left_out_, most);
    return true;
  }

  void Visit(const TriangleBvh::Leaf& leaf) {
    const SupportTag d;
    const auto nx = hn::Set(d, n_float_[0]), ny = hn::Set(d, n_float_[1]),
               nz = hn::Set(d, n_float_[2]);
    auto highest = hn::Set(d, std::numeric_limits<float>::lowest());
    for (std::size_t k = 0; k < kSupportWidth; k += hn::Lanes(d)) {
      for (int row = 0; row < 9; row += 3) {
        const auto along =
            hn::MulAdd(nx, hn::Load(d, leaf.corner[row] + k),
                       hn::MulAdd(ny, hn::Load(d, leaf.corner[row + 1] + k),
                                  hn::Mul(nz, hn::Load(d, leaf.corner[row + 2] + k))));
        highest = hn::Max(highest, along);
      }
    }
    if (LeftOut(hn::GetLane(hn::MaxOfLanes(d, highest)))) return;
    for (std::uint32_t k = leaf.first; k < leaf.first + leaf.count; ++k) {
      const TriangleBvh::Triangle& t = tree_.triangles[k];
      farthest_ = std::max({farthest_, n_.dot(t.a), n_.dot(t.b), n_.dot(t.c)});
    }
  }

  const TriangleBvh::View& tree_;
  const Eigen::Vector3d& n_;
  float n_float_[3];
  double at_origin_, rounding_, slack_;
  double farthest_;
  double left_out_ = -std::numeric_limits<double>::infinity();
};

double FindFarthest(const TriangleBvh::View& tree, const Eigen::Vector3d& n, double slack,
                    double reached) {
  return Farthest(tree, n, slack, reached).Run();
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindFarthest);

double find_farthest(const TriangleBvh::View& tree, const Eigen::Vector3d& n_M, double slack,
                     double reached) {
  return HWY_DYNAMIC_DISPATCH(FindFarthest)(tree, n_M, slack, reached);
}

}  // namespace ist
#endif
