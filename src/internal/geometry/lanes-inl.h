// Small functions of numbers side by side. Compiled once per instruction set: to be included again
// for each.
#if defined(IST_PROXIMITY_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_LANES_INL_H
#undef IST_PROXIMITY_LANES_INL_H
#else
#define IST_PROXIMITY_LANES_INL_H
#endif

#include <hwy/highway.h>

#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace lanes {
namespace hn = hwy::HWY_NAMESPACE;

// Bit k for lane k, of sixteen at most.
template <class D>
HWY_INLINE std::uint32_t MaskBits(D d, hn::Mask<D> mask) {
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return bits[0] | static_cast<std::uint32_t>(bits[1]) << 8U;
}

// Distance of a value from an interval.
template <class D>
HWY_INLINE hn::Vec<D> IntervalDistance(D d, hn::Vec<D> low, hn::Vec<D> high, hn::Vec<D> value) {
  return hn::Max(hn::Max(hn::Sub(low, value), hn::Sub(value, high)), hn::Zero(d));
}

template <class V>
HWY_INLINE V Norm(V x, V y, V z) {
  return hn::Sqrt(hn::MulAdd(x, x, hn::MulAdd(y, y, hn::Mul(z, z))));
}

}  // namespace lanes
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_LANES_INL_H
