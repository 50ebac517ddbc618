// Bundles of rays against a TriangleBvh. Compiled once per instruction set; the best one available
// is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "geometry/ray_kernel.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cmath>
#include <limits>

#include "geometry/ray_kernels.h"
#include "internal/bvh/prefetch.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace ray_bundle {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kWidth = TriangleBvh::kWidth;
using FloatTag = hn::CappedTag<float, kWidth>;
using PacketTag = hn::CappedTag<float, RayPacket::kRays>;
using V = hn::Vec<FloatTag>;

// Writes where an interval of parameters begins, infinity where it is empty.
HWY_INLINE void StoreEnter(V first, V last, float* enter) {
  const FloatTag d;
  const V slack = hn::Mul(hn::Set(d, 1e-6F), hn::Add(hn::Abs(first), hn::Abs(last)));
  const V begin = hn::Sub(first, slack);
  hn::Store(hn::IfThenElse(hn::Le(first, hn::Add(last, slack)), begin,
                           hn::Set(d, std::numeric_limits<float>::infinity())),
            d, enter);
}

// The parameters at which the beam enters the children's boxes; infinite where it misses them.
HWY_INLINE void EnterBoxes(const TriangleBvh::Boxes& boxes, const Beam& beam, float* enter) {
  const FloatTag d;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    V first = hn::Zero(d), last = hn::Set(d, beam.last);
    for (std::size_t i = 0; i < 3; ++i) {
      const V low = hn::Set(d, beam.origin[i] + beam.margin),
              high = hn::Set(d, beam.origin[i] - beam.margin);
      const V at_high = hn::Mul(hn::Sub(hn::Load(d, boxes.min[i] + k), low),
                                hn::Set(d, beam.at_high[i].reciprocal));
      const V at_low = hn::Mul(hn::Sub(hn::Load(d, boxes.max[i] + k), high),
                               hn::Set(d, beam.at_low[i].reciprocal));
      if (beam.at_high[i].is_lower) {
        first = hn::Max(first, at_high);
      } else {
        last = hn::Min(last, at_high);
      }
      if (beam.at_low[i].is_lower) {
        first = hn::Max(first, at_low);
      } else {
        last = hn::Min(last, at_low);
      }
    }
    StoreEnter(first, last, enter + k);
  }
}

// Bit k: ray k of the packet may meet a leaf's box.
HWY_INLINE std::uint32_t EnterLeaf(const TriangleBvh::RayLeaf& leaf, const RayPacket& packet) {
  const PacketTag d;
  std::uint32_t bits = 0;
  for (std::size_t k = 0; k < RayPacket::kRays; k += hn::Lanes(d)) {
    auto first = hn::Zero(d), last = hn::Load(d, packet.last + k);
    for (std::size_t i = 0; i < 3; ++i) {
      const auto reciprocal = hn::Load(d, packet.reciprocal[i] + k);
      const auto a =
          hn::Mul(hn::Set(d, leaf.min[i] - packet.margin - packet.origin[i]), reciprocal);
      const auto b =
          hn::Mul(hn::Set(d, leaf.max[i] + packet.margin - packet.origin[i]), reciprocal);
      first = hn::Max(first, hn::Min(a, b));
      last = hn::Min(last, hn::Max(a, b));
    }
    const auto slack = hn::Mul(hn::Set(d, 1e-6F), hn::Add(hn::Abs(first), hn::Abs(last)));
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, hn::Le(first, hn::Add(last, slack)), bytes);
    bits |= (static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8U)
            << k;
  }
  return bits & packet.rays;
}

struct Vec3 {
  V x, y, z;
};

HWY_INLINE Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {hn::MulSub(a.y, b.z, hn::Mul(a.z, b.y)), hn::MulSub(a.z, b.x, hn::Mul(a.x, b.z)),
          hn::MulSub(a.x, b.y, hn::Mul(a.y, b.x))};
}
HWY_INLINE Vec3 Sub(const Vec3& a, const Vec3& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE V Dot(const Vec3& a, const Vec3& b) {
  return hn::MulAdd(a.x, b.x, hn::MulAdd(a.y, b.y, hn::Mul(a.z, b.z)));
}

// The line through two corners of each triangle of a leaf, by its Pluecker coordinates.
struct Edge {
  Vec3 along, moment;
};
HWY_INLINE Edge EdgeOf(const Vec3& a, const Vec3& b) { return {Sub(b, a), Cross(a, b)}; }

// The triangles of a leaf as seen by a packet of rays.
struct Edges {
  Edge ab, bc, ca;
};
HWY_INLINE Edges EdgesOf(const TriangleBvh::Leaf& leaf, const RayPacket& packet, std::size_t k) {
  const FloatTag t;
  const auto corner = [&](std::size_t c) {
    return Vec3{hn::Sub(hn::Load(t, leaf.corner[3 * c] + k), hn::Set(t, packet.reference[0])),
                hn::Sub(hn::Load(t, leaf.corner[3 * c + 1] + k), hn::Set(t, packet.reference[1])),
                hn::Sub(hn::Load(t, leaf.corner[3 * c + 2] + k), hn::Set(t, packet.reference[2]))};
  };
  const Vec3 a = corner(0), b = corner(1), c = corner(2);
  return {EdgeOf(a, b), EdgeOf(b, c), EdgeOf(c, a)};
}

// Bit k: the line of a ray may cross triangle k. The edge functions of a triangle that is crossed,
// which say on which side of the edges the ray passes, have one sign.
HWY_INLINE std::uint32_t Crossed(const Edges& edges, const RayPacket& packet, std::size_t ray) {
  const FloatTag t;
  const auto of_ray = [&](const float(&v)[3][RayPacket::kRays]) {
    return Vec3{hn::Set(t, v[0][ray]), hn::Set(t, v[1][ray]), hn::Set(t, v[2][ray])};
  };
  const Vec3 d = of_ray(packet.direction), m = of_ray(packet.moment);
  const auto side = [&](const Edge& edge) {
    return hn::Add(Dot(d, edge.moment), Dot(m, edge.along));
  };
  const V ab = side(edges.ab), bc = side(edges.bc), ca = side(edges.ca);
  const V least = hn::Min(ab, hn::Min(bc, ca)), most = hn::Max(ab, hn::Max(bc, ca));
  std::uint8_t bytes[8] = {};
  hn::StoreMaskBits(t, hn::Ge(hn::Max(least, hn::Neg(most)), hn::Set(t, -packet.edge_margin)),
                    bytes);
  return bytes[0];
}

// Adds the triangles of a leaf that the given rays may cross. @returns how many they are
HWY_INLINE std::size_t AddCandidates(const TriangleBvh::View& bvh, const TriangleBvh::Leaf& leaf,
                                     const RayPacket& packet, std::uint32_t rays,
                                     RayCandidate* candidates) {
  std::size_t count = 0;
  for (std::size_t first = 0; first < kWidth; first += hn::Lanes(FloatTag())) {
    const Edges edges = EdgesOf(leaf, packet, first);
    for (std::uint32_t ray = 0; rays >> ray != 0; ++ray) {
      if ((rays >> ray & 1U) == 0) continue;
      const std::uint32_t bits = Crossed(edges, packet, ray) << first & ((1U << leaf.count) - 1U);
      for (std::uint32_t j = 0; bits >> j != 0; ++j) {
        if ((bits >> j & 1U) == 0) continue;
        hwy::Prefetch(bvh.triangles + leaf.first + j);
        candidates[count++] = {ray, leaf.first + j};
      }
    }
  }
  return count;
}

std::size_t FindLeaves(const TriangleBvh::View& bvh, const Beam& beam, TriangleBvh::RayLeaf* leaves,
                       std::size_t capacity) {
  struct Entry {
    std::int32_t node;
    float enter;
  };
  TriangleBvh::Stack<Entry> stack;
  stack.push({0, 0.0F});
  std::size_t count = 0;
  while (!stack.empty()) {
    const TriangleBvh::Boxes& boxes = bvh.boxes[stack.pop().node];
    alignas(32) float enter[kWidth];
    EnterBoxes(boxes, beam, enter);
    const std::size_t siblings = stack.size();
    for (std::size_t k = 0; k < static_cast<std::size_t>(boxes.count); ++k) {
      if (!std::isfinite(enter[k])) continue;
      if (boxes.child[k] >= 0) {
        stack.push_least_on_top<&Entry::enter>(siblings, {boxes.child[k], enter[k]});
        continue;
      }
      if (count == capacity) return count + 1;
      TriangleBvh::RayLeaf& leaf = leaves[count++];
      for (std::size_t i = 0; i < 3; ++i) {
        leaf.min[i] = boxes.min[i][k];
        leaf.max[i] = boxes.max[i][k];
      }
      leaf.leaf = static_cast<std::uint32_t>(~boxes.child[k]);
    }
  }
  return count;
}

std::size_t FindCandidates(const TriangleBvh::View& bvh, const TriangleBvh::RayLeaf* leaves,
                           std::size_t count, const RayPacket& packet, std::size_t* leaf,
                           RayCandidate* candidates) {
  // The leaves of a few steps are fetched while the one before is worked on.
  struct Entered {
    const TriangleBvh::Leaf* leaf;
    std::uint32_t rays;
  };
  Entered entered[kLeavesAhead];
  std::size_t found = 0;
  while (*leaf < count && found == 0) {
    std::size_t size = 0;
    for (; *leaf < count && size < kLeavesAhead; ++*leaf) {
      const std::uint32_t rays = EnterLeaf(leaves[*leaf], packet);
      if (rays == 0) continue;
      entered[size] = {bvh.leaves + leaves[*leaf].leaf, rays};
      prefetch_lines(entered[size].leaf, sizeof(TriangleBvh::Leaf));
      ++size;
    }
    for (std::size_t i = 0; i < size; ++i) {
      found += AddCandidates(bvh, *entered[i].leaf, packet, entered[i].rays, candidates + found);
    }
  }
  return found;
}

}  // namespace ray_bundle

std::size_t FindRayLeaves(const TriangleBvh::View& bvh, const Beam& beam,
                          TriangleBvh::RayLeaf* leaves, std::size_t capacity) {
  return ray_bundle::FindLeaves(bvh, beam, leaves, capacity);
}

std::size_t FindRayCandidates(const TriangleBvh::View& bvh, const TriangleBvh::RayLeaf* leaves,
                              std::size_t count, const RayPacket& packet, std::size_t* leaf,
                              RayCandidate* candidates) {
  return ray_bundle::FindCandidates(bvh, leaves, count, packet, leaf, candidates);
}

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(FindRayLeaves);
HWY_EXPORT(FindRayCandidates);

std::size_t find_leaves(const TriangleBvh::View& bvh, const Beam& beam,
                        TriangleBvh::RayLeaf* leaves, std::size_t capacity) {
  return HWY_DYNAMIC_DISPATCH(FindRayLeaves)(bvh, beam, leaves, capacity);
}

std::size_t find_candidates(const TriangleBvh::View& bvh, const TriangleBvh::RayLeaf* leaves,
                            std::size_t count, const RayPacket& packet, std::size_t* leaf,
                            RayCandidate* candidates) {
  return HWY_DYNAMIC_DISPATCH(FindRayCandidates)(bvh, leaves, count, packet, leaf, candidates);
}

}  // namespace ist
#endif
