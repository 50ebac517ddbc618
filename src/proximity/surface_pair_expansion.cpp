// Pairs of boxes and their children: in float, in the frame of one surface.

#include <algorithm>
#include <optional>

#include "internal/geometry/numbers.h"
#include "proximity/surface_pair_search.h"

namespace ist {
namespace {

// A box of one surface in the frame of the other one.
OrientedBox posed_box(const SurfaceBvh& bvh, SurfaceBvh::Slot slot, const Eigen::Matrix3f& R,
                      const Eigen::Vector3f& p, const Eigen::Vector3f& direction) {
  const SurfaceBvh::Node& node = bvh.node_of(slot);
  const std::size_t k = slot % SurfaceBvh::kWidth;
  const auto column = [k](const float(*rows)[SurfaceBvh::kWidth]) {
    return Eigen::Vector3f(rows[0][k], rows[1][k], rows[2][k]);
  };
  OrientedBox box;
  Eigen::Map<Eigen::Vector3f>(box.center) = R * column(node.center) + p;
  for (int i = 0; i < 3; ++i) {
    Eigen::Map<Eigen::Vector3f>(box.axis[i]) = R * column(node.axis[i]);
    box.half[i] = node.half[i][k];
  }
  Eigen::Map<Eigen::Vector3f>(box.direction) = direction;
  return box;
}

// [m] box_bound() of a node's child.
double child_bound(const ConvexPart& part, const SurfaceBvh::Node& node, std::size_t k) {
  const auto column = [k](const float(*rows)[SurfaceBvh::kWidth]) {
    return Eigen::Vector3d(static_cast<double>(rows[0][k]), static_cast<double>(rows[1][k]),
                           static_cast<double>(rows[2][k]));
  };
  Eigen::Matrix3d axes;
  axes << column(node.axis[0]), column(node.axis[1]), column(node.axis[2]);
  return box_bound(part, column(node.center), axes, column(node.half));
}

}  // namespace

void SurfacePairSearch::set_direction() {
  Eigen::Vector3d n = closest_.on_p - closest_.on_q;
  if (!(closest_.distance > 1e-9 && closest_.distance < kInfinity)) {
    const auto middle = [](const SurfaceBvh& bvh) {
      return bvh.empty() ? Eigen::Vector3d(Eigen::Vector3d::Zero())
                         : Eigen::Vector3d(bvh.bounds().center());
    };
    n = X_BA_ * middle(a_) - middle(b_);
  }
  const double length = n.norm();
  n_B_ = (length > 0.0 ? Eigen::Vector3d(n / length) : Eigen::Vector3d::UnitZ()).cast<float>();
  n_A_ = R_AB_ * n_B_;
}

// The part of a pair that is not divided, in the frame of the one that is: of A or not.
ConvexPart SurfacePairSearch::other_part(const Pair& pair, bool of_a) const {
  return of_a ? posed(b_.part(pair.b), X_AB_) : posed(a_.part(pair.a), X_BA_);
}

// The children of the larger box beside the smaller one: those that are wanted.
// @param children  by bit, 0 for all
SurfacePairSearch::Expansion SurfacePairSearch::expand(const Pair& pair, std::uint8_t children,
                                                       double prune_bound) {
  const std::int32_t child_a = a_.child(pair.a), child_b = b_.child(pair.b);
  const bool of_a = child_b < 0 || (child_a >= 0 && a_.radius(pair.a) >= b_.radius(pair.b));
  alignas(32) float bounds[SurfaceBvh::kWidth];
  const SurfaceBvh::Node& node = of_a ? a_.node(child_a) : b_.node(child_b);
  if (of_a) {
    oriented_box_bounds(node, posed_box(b_, pair.b, R_AB_, p_AB_, n_A_), bounds);
  } else {
    oriented_box_bounds(node, posed_box(a_, pair.a, R_BA_, p_BA_, -n_B_), bounds);
  }
  const std::int32_t other = of_a ? child_b : child_a;
  const double part_radius = of_a ? b_.radius(pair.b) : a_.radius(pair.a);
  std::optional<ConvexPart> part;  // the other one, if it is a single one: posed on first need
  const auto first = static_cast<SurfaceBvh::Slot>((of_a ? child_a : child_b) * SurfaceBvh::kWidth);
  Expansion result;
  result.count = 0;
  result.unwanted = 0;
  result.least_unwanted = kInfinity;
  for (int k = 0; k < node.count; ++k) {
    const auto bit = static_cast<std::uint8_t>(1U << static_cast<unsigned>(k));
    if (children != 0 && (children & bit) == 0) continue;
    double bound = std::max(static_cast<double>(bounds[k]) - rounding_, pair.bound);
    // A part may be much smaller than the box about it, as half of a rectangle is.
    if (other < 0 && bound < prune_bound && part_radius > static_cast<double>(node.radius[k])) {
      if (!part) part = other_part(pair, of_a);
      bound = std::max(bound, child_bound(*part, node, static_cast<std::size_t>(k)) - rounding_);
    }
    if (bound > 0.0 && bound >= prune_bound) {
      result.unwanted = static_cast<std::uint8_t>(result.unwanted | bit);
      result.least_unwanted = std::min(result.least_unwanted, bound);
      continue;
    }
    Pair& child = result.wanted[result.count++];
    child = pair;
    (of_a ? child.a : child.b) = first + static_cast<SurfaceBvh::Slot>(k);
    child.bound = bound > 0.0 ? bound : overlap_order(child);
  }
  return result;
}

}  // namespace ist
