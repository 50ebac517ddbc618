// The test of points against a field of distances. Compiled once per instruction set; the best one
// available is chosen at run time.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cloud/filters/field_verdict_kernel.cpp"
#include "cloud/filters/field_verdict_kernel.h"

#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include <cstddef>

#include "internal/geometry/field_lookup-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace field_verdict {
namespace hn = hwy::HWY_NAMESPACE;

using PointTag = hn::CappedTag<float, static_cast<std::size_t>(kPointWidth)>;
using V = hn::Vec<PointTag>;

HWY_INLINE V Moved(const Eigen::Isometry3f& X, int row, V x, V y, V z) {
  const PointTag d;
  const auto by = [&](int column) { return hn::Set(d, X(row, column)); };
  return hn::MulAdd(by(0), x, hn::MulAdd(by(1), y, hn::MulAdd(by(2), z, by(3))));
}

FieldVerdict TestByField(const DistanceField& field, const Eigen::Isometry3f& X_LO,
                         const PointTile& tile, float padding, float rounding) {
  const PointTag d;
  const field_lookup::FieldLookup lookup(field);
  // The finest grid holds the places that are a few centimetres from the link or nearer. For others
  // the box about the link decides, or nothing does.
  const DistanceField::Level& level = field.levels().front();
  FieldVerdict verdict = {0, 0};
  for (std::size_t k = 0; k < static_cast<std::size_t>(kPointWidth); k += hn::Lanes(d)) {
    const V x_O = hn::Load(d, tile.x + k), y_O = hn::Load(d, tile.y + k),
            z_O = hn::Load(d, tile.z + k);
    const V x = Moved(X_LO, 0, x_O, y_O, z_O), y = Moved(X_LO, 1, x_O, y_O, z_O),
            z = Moved(X_LO, 2, x_O, y_O, z_O);
    const V from_bounds = lookup.FromBounds(d, x, y, z);
    V upper;
    const V lower = lookup.Distance(d, level, x, y, z, from_bounds, &upper);
    const V outside = lookup.OutsideRadius(d, x, y, z, from_bounds);
    const auto is_clear = hn::And(hn::Gt(lower, hn::Set(d, padding + rounding)),
                                  hn::Gt(outside, hn::Set(d, rounding)));
    const auto is_on_robot = hn::Le(upper, hn::Set(d, padding - rounding));
    verdict.clear |= lanes::MaskBits(d, is_clear) << k;
    verdict.on_robot |= lanes::MaskBits(d, is_on_robot) << k;
  }
  return verdict;
}

}  // namespace field_verdict

using field_verdict::TestByField;

}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ist {

HWY_EXPORT(TestByField);

FieldVerdict test_by_field(const DistanceField& field, const Eigen::Isometry3f& X_LO,
                           const PointTile& tile, float padding, float rounding) {
  return HWY_DYNAMIC_DISPATCH(TestByField)(field, X_LO, tile, padding, rounding);
}

}  // namespace ist
#endif
