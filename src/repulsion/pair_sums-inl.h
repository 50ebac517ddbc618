// The sums of a blend over the points of a tile. Compiled once per instruction set: to be included
// again for each.
#if defined(IST_PROXIMITY_PAIR_SUMS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_PAIR_SUMS_INL_H
#undef IST_PROXIMITY_PAIR_SUMS_INL_H
#else
#define IST_PROXIMITY_PAIR_SUMS_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "repulsion/blend_kernel.h"
#include "repulsion/posed_groups-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace blend {

// The sums of each sphere of a group.
struct GroupSums {
  alignas(64) float x[kWidth] = {}, y[kWidth] = {}, z[kWidth] = {};
  alignas(64) float weight[kWidth] = {}, undirected[kWidth] = {};
};

HWY_INLINE float WeightOf(const ThinnedTile& tile, int point) { return tile.weight[point]; }
template <class Boxes>
HWY_INLINE float WeightOf(const Boxes& /*boxes*/, int /*box*/) {
  return 1.0F;
}

// Adds the points of a tile, or its boxes, one by one.
template <class Tile>
HWY_INLINE void AddEach(const Tile& tile, const PosedGroup& group, float nearest,
                        float per_smoothing, GroupSums* sums) {
  const Tag d;
  // A shorter offset has no direction but noise; its weight moves over to the fallback smoothly.
  constexpr float kTiny = 1e-6F;  // [m]
  const V one = hn::Set(d, 1.0F), slope = hn::Set(d, per_smoothing);
  const V tiny_sq = hn::Set(d, kTiny * kTiny), per_tiny_sq = hn::Set(d, 1.0F / (kTiny * kTiny));
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    V x = hn::Load(d, sums->x + k), y = hn::Load(d, sums->y + k), z = hn::Load(d, sums->z + k);
    V weight = hn::Load(d, sums->weight + k), undirected = hn::Load(d, sums->undirected + k);
    // 1 - (d - nearest) / smoothing = start - length / smoothing.
    const V start =
        hn::MulAdd(hn::Add(hn::Load(d, group.radius + k), hn::Set(d, nearest)), slope, one);
    for (int i = 0; i < tile.count; ++i) {
      const Offset o = ToSpheres(tile, i, group, k);
      const V raw = SquaredNorm(o), squared = hn::Max(raw, tiny_sq);
      const V inverse = InverseRoot(squared);
      const V length = hn::Mul(squared, inverse);
      const V root = hn::Max(hn::NegMulAdd(length, slope, start), hn::Zero(d));
      const V w = hn::Mul(hn::Mul(root, root), hn::Set(d, WeightOf(tile, i)));
      const V directed = hn::Mul(w, inverse);
      x = hn::MulAdd(directed, o.x, x);
      y = hn::MulAdd(directed, o.y, y);
      z = hn::MulAdd(directed, o.z, z);
      weight = hn::Add(weight, w);
      const V undefined = hn::Max(hn::NegMulAdd(raw, per_tiny_sq, one), hn::Zero(d));
      undirected = hn::MulAdd(w, undefined, undirected);
    }
    hn::Store(x, d, sums->x + k);
    hn::Store(y, d, sums->y + k);
    hn::Store(z, d, sums->z + k);
    hn::Store(weight, d, sums->weight + k);
    hn::Store(undirected, d, sums->undirected + k);
  }
}

// The middle of some points of a tile; without their spread.
HWY_INLINE PointMoments FindMiddle(const ThinnedTile& tile, int begin, int end) {
  PointMoments m = {};
  for (int i = begin; i < end; ++i) {
    m.weight += tile.weight[i];
    m.middle[0] += tile.weight[i] * tile.x[i];
    m.middle[1] += tile.weight[i] * tile.y[i];
    m.middle[2] += tile.weight[i] * tile.z[i];
  }
  for (float& number : m.middle) number /= m.weight;
  return m;
}

HWY_INLINE void Accumulate(V v, float* sum) {
  const Tag d;
  hn::Store(hn::Add(hn::Load(d, sum), v), d, sum);
}

// The offset from a point to the centres of spheres k, k + 1, ...
HWY_INLINE Offset ToMiddle(const float* middle, const PosedGroup& group, std::size_t k) {
  const Tag d;
  return {hn::Sub(hn::Load(d, group.x + k), hn::Set(d, middle[0])),
          hn::Sub(hn::Load(d, group.y + k), hn::Set(d, middle[1])),
          hn::Sub(hn::Load(d, group.z + k), hn::Set(d, middle[2]))};
}

// The product of a symmetric matrix xx, yy, zz, xy, yz, zx with a vector.
HWY_INLINE Offset Times(const float* S, const Offset& v) {
  const Tag d;
  const V xy = hn::Set(d, S[3]), yz = hn::Set(d, S[4]), zx = hn::Set(d, S[5]);
  return {hn::MulAdd(hn::Set(d, S[0]), v.x, hn::MulAdd(xy, v.y, hn::Mul(zx, v.z))),
          hn::MulAdd(xy, v.x, hn::MulAdd(hn::Set(d, S[1]), v.y, hn::Mul(yz, v.z))),
          hn::MulAdd(zx, v.x, hn::MulAdd(yz, v.y, hn::Mul(hn::Set(d, S[2]), v.z)))};
}

// Adds the slopes of points in one place to those of spheres slot, slot + 1, ...
// n: from the points to the centres; per_length: weight over distance; weight_slope: its derivative
HWY_INLINE void AddSlopes(const Offset& n, V per_length, V weight_slope, std::size_t slot,
                          SphereSums* sums) {
  const V over = hn::Sub(weight_slope, per_length);
  const V x = hn::Mul(over, n.x), y = hn::Mul(over, n.y), z = hn::Mul(over, n.z);
  Accumulate(per_length, sums->per_length + slot);
  Accumulate(weight_slope, sums->weight_slope + slot);
  Accumulate(hn::Mul(weight_slope, n.x), sums->slope[0] + slot);
  Accumulate(hn::Mul(weight_slope, n.y), sums->slope[1] + slot);
  Accumulate(hn::Mul(weight_slope, n.z), sums->slope[2] + slot);
  Accumulate(hn::Mul(x, n.x), sums->outer[0] + slot);
  Accumulate(hn::Mul(y, n.y), sums->outer[1] + slot);
  Accumulate(hn::Mul(z, n.z), sums->outer[2] + slot);
  Accumulate(hn::Mul(x, n.y), sums->outer[3] + slot);
  Accumulate(hn::Mul(y, n.z), sums->outer[4] + slot);
  Accumulate(hn::Mul(z, n.x), sums->outer[5] + slot);
}

// The same of neighbours that are taken for one point.
HWY_INLINE void AddSlopesOf(const PointMoments& m, const PosedGroup& group, std::size_t g,
                            float nearest, float per_smoothing, SphereSums* sums) {
  const Tag d;
  // [m] Nearer to a centre than the points of a tile are to one another, slopes mean nothing.
  constexpr float kLeast = 5e-3F;
  const V slope = hn::Set(d, per_smoothing);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const Offset o = ToMiddle(m.middle, group, k);
    const V squared = hn::Max(SquaredNorm(o), hn::Set(d, kLeast * kLeast));
    const V inverse = InverseRoot(squared);
    const V d_min = hn::Add(hn::Load(d, group.radius + k), hn::Set(d, nearest));
    const V root = hn::Max(
        hn::MulAdd(hn::NegMulAdd(squared, inverse, d_min), slope, hn::Set(d, 1.0F)), hn::Zero(d));
    const V part = hn::Mul(root, hn::Set(d, m.weight));
    const Offset n = {hn::Mul(o.x, inverse), hn::Mul(o.y, inverse), hn::Mul(o.z, inverse)};
    AddSlopes(n, hn::Mul(hn::Mul(part, root), inverse),
              hn::Mul(part, hn::Set(d, -2.0F * per_smoothing)), g * kWidth + k, sums);
  }
}

// Neighbours are taken for one point where the tile is small, as in a dense cloud.
HWY_INLINE void AddSlopesOfEach(const ThinnedTile& tile, const PosedGroup& group, std::size_t g,
                                const Band& band, SphereSums* sums) {
  constexpr float kSmall = 0.6F;  // of the smoothing
  constexpr int kNeighbours = 4;
  const SingleBox& box = tile.box;
  const float x = box.max_x[0] - box.min_x[0], y = box.max_y[0] - box.min_y[0],
              z = box.max_z[0] - box.min_z[0];
  const float small = kSmall * band.smoothing;
  const int step = x * x + y * y + z * z < small * small ? kNeighbours : 1;
  for (int i = 0; i < tile.count; i += step) {
    AddSlopesOf(FindMiddle(tile, i, std::min(i + step, tile.count)), group, g, band.nearest,
                1.0F / band.smoothing, sums);
  }
}

// A tile enters as its moments where the root mean square of its points' distances from their
// middle is no more than this share of the smoothing, and of the distance from the middle to any
// centre. Sums are then off by a few 1e-4 of the weights at most.
constexpr float kMostSpread = 0.15F;
// The same for the slopes alone, of which less is asked.
constexpr float kMostSpreadOfSlopes = 0.3F;

HWY_INLINE float TotalSpread(const PointMoments& m) {
  return m.spread[0] + m.spread[1] + m.spread[2];
}

// The root mean square of the distances of a tile's points from their middle, as a share of the
// smoothing or of the distance from the middle to the nearest centre, squared; the larger one.
HWY_INLINE float RelativeSpreadSq(const PointMoments& m, const PosedGroup& group, float smoothing) {
  const Tag d;
  V least = hn::Set(d, smoothing * smoothing);
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    least = hn::Min(least, SquaredNorm(ToMiddle(m.middle, group, k)));
  }
  constexpr float kLeast = 1e-3F;  // [m] nearer, a direction means nothing
  const float squared = hn::GetLane(hn::MinOfLanes(d, least));
  return squared > kLeast * kLeast ? TotalSpread(m) / (squared * m.weight) : kFarAway;
}

// Adds the points of a small tile. With o from a point to a centre, h = |o|, n = o / h, weight
// w(h), g = w / h, and the spread S of the points about their middle, of trace T, the Taylor
// expansions about the middle are, where points weigh W in all,
//   sum(w)   = W w + (w'' n.S n + w' / h (T - n.S n)) / 2
//   sum(g o) = W g o + ((g'' - g' / h) n.S n + g' / h T) o / 2 + g' S n.
HWY_INLINE void AddMoments(const PointMoments& m, const PosedGroup& group, std::size_t g,
                           const Band& band, GroupSums* sums, SphereSums* slopes) {
  const Tag d;
  const float per_smoothing = 1.0F / band.smoothing;
  const V slope = hn::Set(d, per_smoothing), one = hn::Set(d, 1.0F), half = hn::Set(d, 0.5F);
  const V weight = hn::Set(d, m.weight), trace = hn::Set(d, TotalSpread(m));
  // The second derivative of a weight jumps where the weight ends. There the share of the points
  // that are nearer than that counts, as if they were spread evenly.
  constexpr float kEvenly = 3.46F;  // range of an even distribution, in standard deviations
  constexpr float kLeastSpread = 1e-6F;
  const float deviation = std::sqrt(TotalSpread(m) / m.weight) * per_smoothing;
  const V per_range = hn::Set(d, 1.0F / (kEvenly * std::max(deviation, kLeastSpread)));
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const Offset o = ToMiddle(m.middle, group, k);
    // Far more than rounding, and less than any distance at which a tile is small.
    constexpr float kTiny = 1e-6F;  // [m]
    const V squared = hn::Max(SquaredNorm(o), hn::Set(d, kTiny * kTiny));
    const V r = InverseRoot(squared);
    const V d_min = hn::Add(hn::Load(d, group.radius + k), hn::Set(d, band.nearest));
    const V linear = hn::MulAdd(hn::NegMulAdd(squared, r, d_min), slope, one);
    const V root = hn::Max(linear, hn::Zero(d));
    const V inside = hn::Min(hn::Max(hn::MulAdd(linear, per_range, half), hn::Zero(d)), one);
    const V w = hn::Mul(root, root);
    const V w1 = hn::Mul(root, hn::Set(d, -2.0F * per_smoothing));
    const V w2 = hn::Mul(inside, hn::Set(d, 2.0F * per_smoothing * per_smoothing));
    const V g0 = hn::Mul(w, r);
    const V g1 = hn::Mul(hn::Sub(w1, g0), r);
    const V g2 = hn::Mul(hn::NegMulAdd(hn::Set(d, 2.0F), g1, w2), r);

    const Offset n = {hn::Mul(o.x, r), hn::Mul(o.y, r), hn::Mul(o.z, r)};
    const Offset Sn = Times(m.spread, n);
    const V nSn = hn::MulAdd(n.x, Sn.x, hn::MulAdd(n.y, Sn.y, hn::Mul(n.z, Sn.z)));
    const V bent = hn::MulAdd(w2, nSn, hn::Mul(hn::Mul(w1, r), hn::Sub(trace, nSn)));
    const V sum = hn::Max(hn::MulAdd(weight, w, hn::Mul(half, bent)), hn::Zero(d));
    const V g1_over = hn::Mul(g1, r);
    const V along = hn::MulAdd(hn::Sub(g2, g1_over), nSn, hn::Mul(g1_over, trace));
    const V part = hn::MulAdd(weight, g0, hn::Mul(half, along));
    Accumulate(hn::MulAdd(part, o.x, hn::Mul(g1, Sn.x)), sums->x + k);
    Accumulate(hn::MulAdd(part, o.y, hn::Mul(g1, Sn.y)), sums->y + k);
    Accumulate(hn::MulAdd(part, o.z, hn::Mul(g1, Sn.z)), sums->z + k);
    Accumulate(sum, sums->weight + k);
    if (slopes == nullptr) continue;
    AddSlopes(n, hn::Mul(weight, g0), hn::Mul(weight, w1), g * kWidth + k, slopes);
  }
}

// Adds the points of a tile to the sums of a group of spheres.
HWY_INLINE void Add(const ThinnedTile& tile, const PosedGroup& group, std::size_t g,
                    const Band& band, GroupSums* sums, SphereSums* slopes) {
  const float spread_sq = RelativeSpreadSq(tile.moments, group, band.smoothing);
  if (spread_sq <= kMostSpread * kMostSpread) {
    AddMoments(tile.moments, group, g, band, sums, slopes);
    return;
  }
  AddEach(tile, group, band.nearest, 1.0F / band.smoothing, sums);
  if (slopes == nullptr) return;
  if (spread_sq <= kMostSpreadOfSlopes * kMostSpreadOfSlopes) {
    AddSlopesOf(tile.moments, group, g, band.nearest, 1.0F / band.smoothing, slopes);
  } else {
    AddSlopesOfEach(tile, group, g, band, slopes);
  }
}

// Adds boxes, which have no slopes.
template <class Boxes>
HWY_INLINE void Add(const Boxes& boxes, const PosedGroup& group, std::size_t /*g*/,
                    const Band& band, GroupSums* sums, SphereSums* /*slopes*/) {
  AddEach(boxes, group, band.nearest, 1.0F / band.smoothing, sums);
}

HWY_INLINE float Sum(V v) { return hn::GetLane(hn::SumOfLanes(Tag(), v)); }

HWY_INLINE PairSums Total(const GroupSums& sums, const PosedGroup& group) {
  const Tag d;
  PairSums total;
  for (std::size_t k = 0; k < kWidth; k += hn::Lanes(d)) {
    const V x = hn::Load(d, sums.x + k), y = hn::Load(d, sums.y + k), z = hn::Load(d, sums.z + k);
    const V ax = hn::Load(d, group.arm_x + k), ay = hn::Load(d, group.arm_y + k),
            az = hn::Load(d, group.arm_z + k);
    const V undirected = hn::Load(d, sums.undirected + k);
    total.weight += Sum(hn::Load(d, sums.weight + k));
    total.force[0] += Sum(x);
    total.force[1] += Sum(y);
    total.force[2] += Sum(z);
    total.torque[0] += Sum(hn::NegMulAdd(az, y, hn::Mul(ay, z)));
    total.torque[1] += Sum(hn::NegMulAdd(ax, z, hn::Mul(az, x)));
    total.torque[2] += Sum(hn::NegMulAdd(ay, x, hn::Mul(ax, y)));
    total.undirected += Sum(undirected);
    total.undirected_arm[0] += Sum(hn::Mul(undirected, ax));
    total.undirected_arm[1] += Sum(hn::Mul(undirected, ay));
    total.undirected_arm[2] += Sum(hn::Mul(undirected, az));
  }
  return total;
}

}  // namespace blend
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif
