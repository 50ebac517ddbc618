// Compiled once per instruction set: to be included within what HWY_TARGET_INCLUDE names.
#if defined(IST_CLOUD_COMPRESS_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_CLOUD_COMPRESS_INL_H_
#undef IST_CLOUD_COMPRESS_INL_H_
#else
#define IST_CLOUD_COMPRESS_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>
#include <cstdint>

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace compress {

/// Moves the numbers of some lanes to the front; the other lanes are undefined.
///
/// This is hwy::Compress where the processor has such an instruction. Elsewhere Highway 1.0, built
/// by GCC, copies its table at each call; this one reads the table in place, once for several
/// vectors.
#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4 || HWY_TARGET == HWY_SSSE3

template <std::size_t kLanes>
constexpr auto kCompressOrder = [] {
  std::array<std::array<std::uint32_t, kLanes>, std::size_t{1} << kLanes> order{};
  for (std::size_t bits = 0; bits < order.size(); ++bits) {
    std::size_t n = 0;
    for (std::uint32_t k = 0; k < kLanes; ++k) {
      if ((bits >> k & 1U) != 0) order[bits][n++] = k;
    }
  }
  return order;
}();

template <class D>
class Compressor {
 public:
  template <class M>
  HWY_INLINE explicit Compressor(const M& mask) {
    const hwy::HWY_NAMESPACE::RebindToUnsigned<D> du;
    std::uint8_t bits[8] = {};
    hwy::HWY_NAMESPACE::StoreMaskBits(D(), mask, bits);
    order_ = hwy::HWY_NAMESPACE::LoadU(
        du, kCompressOrder<hwy::HWY_NAMESPACE::MaxLanes(D())>[bits[0]].data());
  }
  template <class D2>
  HWY_INLINE hwy::HWY_NAMESPACE::Vec<D2> operator()(D2 d, hwy::HWY_NAMESPACE::Vec<D2> v) const {
    return hwy::HWY_NAMESPACE::TableLookupLanes(v, hwy::HWY_NAMESPACE::IndicesFromVec(d, order_));
  }

 private:
  hwy::HWY_NAMESPACE::Vec<hwy::HWY_NAMESPACE::RebindToUnsigned<D>> order_;
};

#else

template <class D>
class Compressor {
 public:
  HWY_INLINE explicit Compressor(hwy::HWY_NAMESPACE::Mask<D> mask) : mask_(mask) {}
  template <class D2>
  HWY_INLINE hwy::HWY_NAMESPACE::Vec<D2> operator()(D2 d, hwy::HWY_NAMESPACE::Vec<D2> v) const {
    return hwy::HWY_NAMESPACE::Compress(v, hwy::HWY_NAMESPACE::RebindMask(d, mask_));
  }

 private:
  hwy::HWY_NAMESPACE::Mask<D> mask_;
};

#endif

}  // namespace compress
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif
