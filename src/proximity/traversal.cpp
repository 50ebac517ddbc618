// Compiled once per instruction set; the best one there is gets chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "proximity/traversal.cpp"
#include "proximity/traversal.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <algorithm>
#include <cassert>
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// A pair of a tree node's child and a box. It carries both volumes, so expanding one side does not
// touch the other's memory.
struct Pair {
  float bound;
  std::int32_t slot;         // of the sphere in `support`
  std::int32_t sphere, box;  // child indices: >= 0 node, < 0 leaf or tile
  float x, y, z, radius;     // the sphere, posed
  float min[3], max[3];
};

constexpr std::size_t kStackSize = 1024;  // 7 siblings a level of spheres, 15 of boxes, and room
constexpr std::uint64_t kExpiryInterval = 16;

using SphereTag = hn::CappedTag<float, static_cast<std::size_t>(kSphereWidth)>;
using PointTag = hn::CappedTag<float, static_cast<std::size_t>(kPointWidth)>;

template <class D>
HWY_INLINE hn::Vec<D> Gap(D d, hn::Vec<D> low, hn::Vec<D> high, hn::Vec<D> value) {
  return hn::Max(hn::Max(hn::Sub(low, value), hn::Sub(value, high)), hn::Zero(d));
}

template <class V>
HWY_INLINE V Norm(V x, V y, V z) {
  return hn::Sqrt(hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z))));
}

// The circle in which a plane `height` above a ball's centre cuts it: its radius, at least.
template <class D>
HWY_INLINE hn::Vec<D> RimRadius(D d, hn::Vec<D> radius, hn::Vec<D> height, float rounding) {
  const auto slack = hn::Set(d, rounding);
  const auto least = hn::Max(hn::Sub(hn::Abs(height), slack), hn::Zero(d));
  const auto squared = hn::NegMulAdd(least, least, hn::Mul(radius, radius));
  return hn::Add(hn::Sqrt(hn::Max(squared, hn::Zero(d))), slack);
}

// How far what is `ahead` of the plane, and `aside` of the ball's axis across it, is from what the
// plane leaves of the ball: from the rim, where the ball's nearest point is cut off. Otherwise only
// the plane tells.
template <class D>
HWY_INLINE hn::Vec<D> CutDistance(D d, hn::Vec<D> ahead, hn::Vec<D> aside, hn::Vec<D> radius,
                                  hn::Vec<D> height, hn::Vec<D> rim) {
  const auto zero = hn::Zero(d);
  const auto over_center = hn::Add(ahead, height);
  const auto over_sq = hn::Mul(over_center, over_center);
  const auto lowest = hn::Min(ahead, over_center);
  const auto is_cut =
      hn::And(hn::Gt(lowest, zero),
              hn::Gt(hn::Mul(hn::Mul(radius, radius), over_sq),
                     hn::Mul(hn::Mul(height, hn::Abs(height)), hn::MulAdd(aside, aside, over_sq))));
  const auto beyond = hn::Max(hn::Sub(aside, rim), zero);
  const auto to_rim = hn::Sqrt(hn::MulAdd(ahead, ahead, hn::Mul(beyond, beyond)));
  return hn::IfThenElse(is_cut, to_rim, ahead);
}

struct Posed {
  alignas(64) float x[kSphereWidth], y[kSphereWidth], z[kSphereWidth];
};

// Eight centres from the link's frame into the index's.
HWY_INLINE void Pose(const Traversal& t, const float* x, const float* y, const float* z,
                     Posed* posed) {
  const SphereTag d;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
    const auto vx = hn::Load(d, x + k), vy = hn::Load(d, y + k), vz = hn::Load(d, z + k);
    float* out[3] = {posed->x, posed->y, posed->z};
    for (int row = 0; row < 3; ++row) {
      const float* r = t.R_OL + 3 * row;
      const auto sum =
          hn::MulAdd(hn::Set(d, r[0]), vx,
                     hn::MulAdd(hn::Set(d, r[1]), vy,
                                hn::MulAdd(hn::Set(d, r[2]), vz, hn::Set(d, t.p_OL[row]))));
      hn::Store(sum, d, out[row] + k);
    }
  }
}

template <bool kExact, bool kBoxes>
class Descent {
 public:
  explicit Descent(Traversal* traversal) : t_(*traversal) {}

  void Run() {
    PushRoot();
    while (top_ > 0) {
      const Pair pair = stack_[--top_];
      if (!(pair.bound < Limit())) {
        Drop(pair.bound);
        continue;
      }
      if (t_.node_pairs >= t_.aim_after) {
        t_.aim_after = kNever;
        t_.aim(t_.context);
      }
      if (kExact && t_.may_be_inside && t_.threshold <= t_.interior) {
        // What is left is outside and too far, or is the depth query's.
        Drop(t_.interior);
        return;
      }
      if (++t_.node_pairs % kExpiryInterval == 0 && t_.expired != nullptr &&
          t_.expired(t_.context)) {
        t_.stopped = true;
        Drop(pair.bound);
        while (top_ > 0) Drop(stack_[--top_].bound);
        return;
      }
      if (pair.sphere < 0 && pair.box < 0) {
        Leaves(pair);
      } else if (pair.sphere < 0 || (pair.box >= 0 && BoxIsLarger(pair))) {
        ExpandBox(pair);
      } else {
        ExpandSphere(pair);
      }
    }
  }

 private:
  float Limit() const {
    return kExact ? std::max(t_.threshold, t_.interior) : std::min(t_.threshold, t_.inner_distance);
  }

  void Drop(float bound) { t_.dropped = std::min(t_.dropped, bound); }

  static bool BoxIsLarger(const Pair& pair) {
    float size_sq = 0.0F;
    for (int i = 0; i < 3; ++i) {
      size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
    }
    return size_sq > 4.0F * pair.radius * pair.radius;
  }

  // The root pair's volumes are never compared: it is expanded on the sphere's side first.
  void PushRoot() {
    Pair root{};
    root.bound = -std::numeric_limits<float>::infinity();
    root.radius = std::numeric_limits<float>::infinity();
    root.box = t_.box_root;
    for (int i = 0; i < 3; ++i) {
      root.min[i] = -kFarAway;
      root.max[i] = kFarAway;
    }
    stack_[top_++] = root;
  }

  // Keeps the children from `begin` up sorted, the nearest on top.
  HWY_INLINE void Insert(std::size_t begin, const Pair& pair) {
    assert(top_ < kStackSize);
    std::size_t at = top_++;
    for (; at > begin && stack_[at - 1].bound < pair.bound; --at) stack_[at] = stack_[at - 1];
    stack_[at] = pair;
  }

  // Bit k for a bound below the limit; the least of the others is kept, of unused slots too, which
  // are far away.
  template <class D, class V>
  static HWY_INLINE std::uint32_t Below(D d, V bound, float limit, V* dropped) {
    const auto below = hn::Lt(bound, hn::Set(d, limit));
    *dropped = hn::Min(*dropped, hn::IfThenElse(below, *dropped, bound));
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(d, below, bits);
    return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U;
  }

  void ExpandSphere(const Pair& pair) {
    const SphereNode& node = t_.sphere_nodes[pair.sphere];
    const SphereTag d;
    Posed posed;
    Pose(t_, node.x, node.y, node.z, &posed);
    const auto ahead = hn::Set(d, Ahead(pair));
    const Middle box = MiddleOf(pair);
    const float* support = t_.support + pair.sphere * kSphereWidth;
    const float limit = Limit();
    std::uint32_t near = 0;
    auto dropped = hn::Set(d, kFarAway);
    alignas(64) float bound[kSphereWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereWidth); k += hn::Lanes(d)) {
      const auto dx =
          Gap(d, hn::Set(d, pair.min[0]), hn::Set(d, pair.max[0]), hn::Load(d, posed.x + k));
      const auto dy =
          Gap(d, hn::Set(d, pair.min[1]), hn::Set(d, pair.max[1]), hn::Load(d, posed.y + k));
      const auto dz =
          Gap(d, hn::Set(d, pair.min[2]), hn::Set(d, pair.max[2]), hn::Load(d, posed.z + k));
      const auto x = hn::Load(d, posed.x + k), y = hn::Load(d, posed.y + k),
                 z = hn::Load(d, posed.z + k), radius = hn::Load(d, node.radius + k);
      const auto reach = hn::LoadU(d, support + k);
      const auto apart = hn::Sub(Norm(dx, dy, dz), radius);
      const auto height = hn::Sub(hn::Add(hn::Set(d, t_.offset), reach), Along(d, x, y, z));
      const auto aside =
          hn::Sub(Aside(d, hn::Sub(hn::Set(d, box.x), x), hn::Sub(hn::Set(d, box.y), y),
                        hn::Sub(hn::Set(d, box.z), z)),
                  hn::Set(d, box.radius));
      const auto least =
          hn::Max(apart, CutDistance(d, hn::Sub(ahead, reach), hn::Max(aside, hn::Zero(d)), radius,
                                     height, RimRadius(d, radius, height, t_.rounding)));
      near |= Below(d, least, limit, &dropped) << k;
      hn::Store(least, d, bound + k);
    }
    near &= (1U << static_cast<std::uint32_t>(node.count)) - 1U;
    Drop(hn::GetLane(hn::MinOfLanes(d, dropped)));
    Pair child = pair;
    const std::size_t begin = top_;
    for (; near != 0; near &= near - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
      child.bound = bound[k];
      child.slot = pair.sphere * kSphereWidth + k;
      child.sphere = node.child[k];
      child.x = posed.x[k];
      child.y = posed.y[k];
      child.z = posed.z[k];
      child.radius = node.radius[k];
      Insert(begin, child);
    }
  }

  void ExpandBox(const Pair& pair) {
    const BoxNode& node = t_.box_nodes[pair.box];
    const PointTag d;
    const float offset = t_.offset + t_.support[pair.slot];
    const float center[3] = {pair.x, pair.y, pair.z};
    const auto radius = hn::Set(d, pair.radius);
    const auto height = hn::Sub(
        hn::Set(d, offset), Along(d, hn::Set(d, pair.x), hn::Set(d, pair.y), hn::Set(d, pair.z)));
    const auto rim = RimRadius(d, radius, height, t_.rounding);
    const float limit = Limit();
    std::uint32_t near = 0;
    auto dropped = hn::Set(d, kFarAway);
    alignas(64) float bound[kPointWidth];
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto dx =
          Gap(d, hn::Load(d, node.min_x + k), hn::Load(d, node.max_x + k), hn::Set(d, pair.x));
      const auto dy =
          Gap(d, hn::Load(d, node.min_y + k), hn::Load(d, node.max_y + k), hn::Set(d, pair.y));
      const auto dz =
          Gap(d, hn::Load(d, node.min_z + k), hn::Load(d, node.max_z + k), hn::Set(d, pair.z));
      const auto apart = hn::Sub(Norm(dx, dy, dz), radius);
      const auto least = hn::Max(apart, CutDistance(d, Ahead(node, k, offset),
                                                    Aside(node, k, center), radius, height, rim));
      near |= Below(d, least, limit, &dropped) << k;
      hn::Store(least, d, bound + k);
    }
    near &= (1U << static_cast<std::uint32_t>(node.count)) - 1U;
    Drop(hn::GetLane(hn::MinOfLanes(d, dropped)));
    Pair child = pair;
    const std::size_t begin = top_;
    for (; near != 0; near &= near - 1) {
      const auto k = static_cast<int>(hwy::Num0BitsBelowLS1Bit_Nonzero32(near));
      child.bound = bound[k];
      child.box = node.child[k];
      child.min[0] = node.min_x[k];
      child.min[1] = node.min_y[k];
      child.min[2] = node.min_z[k];
      child.max[0] = node.max_x[k];
      child.max[1] = node.max_y[k];
      child.max[2] = node.max_z[k];
      Insert(begin, child);
    }
  }

  struct Middle {
    float x, y, z, radius;
  };
  static Middle MiddleOf(const Pair& pair) {
    float size_sq = 0.0F;
    for (int i = 0; i < 3; ++i) {
      size_sq += (pair.max[i] - pair.min[i]) * (pair.max[i] - pair.min[i]);
    }
    return {0.5F * (pair.min[0] + pair.max[0]), 0.5F * (pair.min[1] + pair.max[1]),
            0.5F * (pair.min[2] + pair.max[2]), 0.5F * std::sqrt(size_sq)};
  }

  // Of a box before the plane through the link's origin.
  HWY_INLINE float Ahead(const Pair& pair) const {
    float ahead = -t_.offset;
    for (int i = 0; i < 3; ++i) {
      ahead += t_.normal[i] * (t_.normal[i] > 0.0F ? pair.min[i] : pair.max[i]);
    }
    return ahead;
  }
  // Of sixteen points, or boxes, before the plane at `offset`.
  HWY_INLINE hn::Vec<PointTag> Ahead(const float* x, const float* y, const float* z,
                                     float offset) const {
    const PointTag d;
    return hn::MulAdd(
        hn::Set(d, t_.normal[0]), hn::Load(d, x),
        hn::MulAdd(hn::Set(d, t_.normal[1]), hn::Load(d, y),
                   hn::MulAdd(hn::Set(d, t_.normal[2]), hn::Load(d, z), hn::Set(d, -offset))));
  }
  HWY_INLINE hn::Vec<PointTag> Ahead(const PointTile& tile, std::size_t k, float offset) const {
    return Ahead(tile.x + k, tile.y + k, tile.z + k, offset);
  }
  template <class Boxes>
  HWY_INLINE hn::Vec<PointTag> Ahead(const Boxes& boxes, std::size_t k, float offset) const {
    return Ahead((t_.normal[0] > 0.0F ? boxes.min_x : boxes.max_x) + k,
                 (t_.normal[1] > 0.0F ? boxes.min_y : boxes.max_y) + k,
                 (t_.normal[2] > 0.0F ? boxes.min_z : boxes.max_z) + k, offset);
  }

  template <class D>
  HWY_INLINE hn::Vec<D> Along(D d, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) const {
    return hn::MulAdd(
        hn::Set(d, t_.normal[0]), x,
        hn::MulAdd(hn::Set(d, t_.normal[1]), y, hn::Mul(hn::Set(d, t_.normal[2]), z)));
  }

  // Length of what is left of vectors across the normal.
  template <class D>
  HWY_INLINE hn::Vec<D> Aside(D d, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) const {
    const auto along = Along(d, x, y, z);
    return Norm(hn::NegMulAdd(hn::Set(d, t_.normal[0]), along, x),
                hn::NegMulAdd(hn::Set(d, t_.normal[1]), along, y),
                hn::NegMulAdd(hn::Set(d, t_.normal[2]), along, z));
  }
  // How far sixteen boxes, or points, are aside of the pair's ball, at least.
  HWY_INLINE hn::Vec<PointTag> Aside(const PointTile& tile, std::size_t k,
                                     const float* center) const {
    const PointTag d;
    return Aside(d, hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, center[0])),
                 hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, center[1])),
                 hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, center[2])));
  }
  template <class Boxes>
  HWY_INLINE hn::Vec<PointTag> Aside(const Boxes& boxes, std::size_t k, const float* center) const {
    const PointTag d;
    const auto half = hn::Set(d, 0.5F);
    const auto middle = [&](const float* min, const float* max, float c) {
      return hn::Sub(hn::Mul(half, hn::Add(hn::Load(d, min + k), hn::Load(d, max + k))),
                     hn::Set(d, c));
    };
    const auto extent = [&](const float* min, const float* max) {
      return hn::Mul(half, hn::Sub(hn::Load(d, max + k), hn::Load(d, min + k)));
    };
    const auto aside = Aside(d, middle(boxes.min_x, boxes.max_x, center[0]),
                             middle(boxes.min_y, boxes.max_y, center[1]),
                             middle(boxes.min_z, boxes.max_z, center[2]));
    const auto around = Norm(extent(boxes.min_x, boxes.max_x), extent(boxes.min_y, boxes.max_y),
                             extent(boxes.min_z, boxes.max_z));
    return hn::Max(hn::Sub(aside, around), hn::Zero(d));
  }

  // From sixteen points, or boxes, to a place.
  HWY_INLINE hn::Vec<PointTag> Distance(const PointTile& tile, std::size_t k, float x, float y,
                                        float z) const {
    const PointTag d;
    return Norm(hn::Sub(hn::Load(d, tile.x + k), hn::Set(d, x)),
                hn::Sub(hn::Load(d, tile.y + k), hn::Set(d, y)),
                hn::Sub(hn::Load(d, tile.z + k), hn::Set(d, z)));
  }
  HWY_INLINE hn::Vec<PointTag> Distance(const BoxTile& tile, std::size_t k, float x, float y,
                                        float z) const {
    const PointTag d;
    return Norm(Gap(d, hn::Load(d, tile.min_x + k), hn::Load(d, tile.max_x + k), hn::Set(d, x)),
                Gap(d, hn::Load(d, tile.min_y + k), hn::Load(d, tile.max_y + k), hn::Set(d, y)),
                Gap(d, hn::Load(d, tile.min_z + k), hn::Load(d, tile.max_z + k), hn::Set(d, z)));
  }

  HWY_INLINE void Leaves(const Pair& pair) {
    if constexpr (kBoxes) {
      Leaves(pair, t_.box_tiles[~pair.box]);
    } else {
      Leaves(pair, t_.tiles[~pair.box]);
    }
  }

  // Up to 8 balls against 16 points or boxes: for each of these the least distance to a ball.
  template <class Tile>
  HWY_INLINE void Leaves(const Pair& pair, const Tile& tile) {
    ++t_.leaf_pairs;
    const SphereLeaf& leaf = t_.sphere_leaves[~pair.sphere];
    const std::int32_t tile_index = ~pair.box;
    Posed posed;
    Pose(t_, leaf.x, leaf.y, leaf.z, &posed);
    const float* radius = kExact ? leaf.outer : leaf.inner;
    const float offset = t_.offset + t_.support[pair.slot];
    const PointTag d;
    alignas(64) float distance[kPointWidth];
    bool is_near = false;
    const auto limit = hn::Set(d, Limit());
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto ahead = Ahead(tile, k, offset);
      auto nearest = hn::Set(d, kFarAway);
      for (int b = 0; b < leaf.count; ++b) {
        const auto to_center = Distance(tile, k, posed.x[b], posed.y[b], posed.z[b]);
        nearest = hn::Min(nearest, hn::Sub(to_center, hn::Set(d, radius[b])));
      }
      nearest = hn::Max(nearest, ahead);
      is_near = is_near || !hn::AllFalse(d, hn::Lt(nearest, limit));
      hn::Store(nearest, d, distance + k);
    }
    if (!kExact) return Nearest(pair, distance);
    if (is_near) LookCloser(pair, leaf, posed, tile, offset, distance);
    Candidates(tile_index, tile.count, distance);
  }

  // Unused lanes are far away.
  void Nearest(const Pair& pair, const float* inner) {
    for (int k = 0; k < kPointWidth; ++k) {
      if (!(inner[k] < t_.inner_distance)) continue;
      t_.inner_distance = inner[k];
      t_.inner_tile = ~pair.box;
      t_.inner_lane = k;
      t_.inner_leaf = ~pair.sphere;
    }
  }

  // What the plane leaves of the balls, and how far the points are at most.
  template <class Tile>
  HWY_INLINE void LookCloser(const Pair& pair, const SphereLeaf& leaf, const Posed& posed,
                             const Tile& tile, float offset, float* distance) {
    const PointTag d;
    const SphereTag balls;
    alignas(64) float height[kSphereWidth], rim[kSphereWidth], inner[kPointWidth];
    for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(balls)) {
      const auto over = hn::Sub(hn::Set(balls, offset),
                                Along(balls, hn::Load(balls, posed.x + b),
                                      hn::Load(balls, posed.y + b), hn::Load(balls, posed.z + b)));
      hn::Store(over, balls, height + b);
      hn::Store(RimRadius(balls, hn::Load(balls, leaf.outer + b), over, t_.rounding), balls,
                rim + b);
    }
    bool is_nearer = false;
    for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
      const auto ahead = Ahead(tile, k, offset);
      auto nearest = hn::Set(d, kFarAway), nearest_inner = nearest;
      for (int b = 0; b < leaf.count; ++b) {
        const float center[3] = {posed.x[b], posed.y[b], posed.z[b]};
        const auto radius = hn::Set(d, leaf.outer[b]);
        const auto to_center = Distance(tile, k, center[0], center[1], center[2]);
        const auto cut = CutDistance(d, ahead, Aside(tile, k, center), radius,
                                     hn::Set(d, height[b]), hn::Set(d, rim[b]));
        nearest = hn::Min(nearest, hn::Max(hn::Sub(to_center, radius), cut));
        nearest_inner = hn::Min(nearest_inner, hn::Sub(to_center, hn::Set(d, leaf.inner[b])));
      }
      hn::Store(hn::Max(nearest, hn::Load(d, distance + k)), d, distance + k);
      hn::Store(nearest_inner, d, inner + k);
      is_nearer =
          is_nearer || !hn::AllFalse(d, hn::Lt(nearest_inner, hn::Set(d, t_.inner_distance)));
    }
    if (!is_nearer || t_.nearer == nullptr) return;
    Nearest(pair, inner);
    t_.nearer(t_.context);
  }

  // The most promising first: it may spare the others.
  void Candidates(std::int32_t tile, int count, const float* bound) {
    int first = 0;
    for (int k = 1; k < count; ++k) first = bound[k] < bound[first] ? k : first;
    Candidate(tile, first, bound[first]);
    for (int k = 0; k < count; ++k) {
      if (k != first) Candidate(tile, k, bound[k]);
    }
  }

  HWY_INLINE void Candidate(std::int32_t tile, int k, float bound) {
    if (bound <= t_.interior) {
      t_.may_be_inside = true;
    } else if (bound < t_.threshold) {
      t_.candidate(t_.context, tile, k, bound);
    } else {
      Drop(bound);
    }
  }

  Traversal& t_;
  std::size_t top_ = 0;
  Pair stack_[kStackSize];
};

// How far a leaf's outer balls reach, or `most`; but never short of a centre: what planes leave of
// a ball then has everything that is near the ball before the plane.
float LeafSupport(const SphereLeaf& leaf, const float* n, float most) {
  const SphereTag d;
  const auto nx = hn::Set(d, n[0]), ny = hn::Set(d, n[1]), nz = hn::Set(d, n[2]);
  const auto nowhere = hn::Set(d, kNowhere);
  auto farthest = nowhere, center = nowhere;
  for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(d)) {
    const auto outer = hn::Load(d, leaf.outer + b);
    const auto along =
        hn::MulAdd(nx, hn::Load(d, leaf.x + b),
                   hn::MulAdd(ny, hn::Load(d, leaf.y + b), hn::Mul(nz, hn::Load(d, leaf.z + b))));
    farthest = hn::Max(farthest, hn::Add(along, outer));
    center = hn::Max(center, hn::IfThenElse(hn::Gt(outer, nowhere), along, nowhere));
  }
  return std::min(hn::GetLane(hn::MaxOfLanes(d, farthest)),
                  std::max(hn::GetLane(hn::MaxOfLanes(d, center)), most));
}

// Nodes follow their parents. Unused slots reach nowhere: balls by their radius, children by what
// `support` is filled with.
void FindSupport(const InnerSphereTree& tree, const float* n, float most, float* support) {
  const SphereTag d;
  for (std::size_t i = tree.nodes().size(); i-- > 0;) {
    const SphereNode& node = tree.nodes()[i];
    float* here = support + i * static_cast<std::size_t>(kSphereWidth);
    for (int k = 0; k < node.count; ++k) {
      const std::int32_t child = node.child[k];
      if (child < 0) {
        here[k] = LeafSupport(tree.leaves()[static_cast<std::size_t>(~child)], n, most);
        continue;
      }
      auto farthest = hn::Set(d, -kFarAway);
      for (std::size_t b = 0; b < static_cast<std::size_t>(kSphereWidth); b += hn::Lanes(d)) {
        farthest = hn::Max(farthest, hn::LoadU(d, support + child * kSphereWidth + b));
      }
      here[k] = hn::GetLane(hn::MaxOfLanes(d, farthest));
    }
  }
}

void DescendInner(Traversal* traversal) { Descent<false, false>(traversal).Run(); }
void DescendExact(Traversal* traversal) { Descent<true, false>(traversal).Run(); }
void DescendInnerBoxes(Traversal* traversal) { Descent<false, true>(traversal).Run(); }
void DescendExactBoxes(Traversal* traversal) { Descent<true, true>(traversal).Run(); }

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindSupport);
HWY_EXPORT(DescendInner);
HWY_EXPORT(DescendExact);
HWY_EXPORT(DescendInnerBoxes);
HWY_EXPORT(DescendExactBoxes);

void find_support(const InnerSphereTree& tree, const float n[3], float most, float* support) {
  HWY_DYNAMIC_DISPATCH(FindSupport)(tree, n, most, support);
}

void descend_inner(Traversal* traversal) {
  if (traversal->box_tiles != nullptr) {
    HWY_DYNAMIC_DISPATCH(DescendInnerBoxes)(traversal);
  } else {
    HWY_DYNAMIC_DISPATCH(DescendInner)(traversal);
  }
}

void descend_exact(Traversal* traversal) {
  if (traversal->box_tiles != nullptr) {
    HWY_DYNAMIC_DISPATCH(DescendExactBoxes)(traversal);
  } else {
    HWY_DYNAMIC_DISPATCH(DescendExact)(traversal);
  }
}

}  // namespace ist
#endif
