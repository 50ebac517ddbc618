// Looks places up in a field of distances, as many at a time as a vector has lanes. Compiled once
// per instruction set: to be included again for each.
#if defined(IST_PROXIMITY_FIELD_LOOKUP_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef IST_PROXIMITY_FIELD_LOOKUP_INL_H
#undef IST_PROXIMITY_FIELD_LOOKUP_INL_H
#else
#define IST_PROXIMITY_FIELD_LOOKUP_INL_H
#endif

#include <hwy/highway.h>

#include "internal/geometry/distance_field.h"
#include "internal/geometry/lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace ist {
namespace HWY_NAMESPACE {
namespace field_lookup {
namespace hn = hwy::HWY_NAMESPACE;

// The errors of float: a share of what is squared, and of a place [m]: 2^-24 of a coordinate in
// cells, of which a grid has fewer than a thousand, in cells of a few centimetres.
constexpr float kSquareError = 2e-6F, kPlaceError = 4e-6F;

// sqrt(interpolated - variance), of squared distances that were interpolated: see DistanceField.
template <class D, class V = hn::Vec<D>>
HWY_INLINE V LessVariance(D d, V interpolated, V variance) {
  const auto squared = hn::Mul(interpolated, hn::Set(d, 1.0F - kSquareError));
  return hn::Sqrt(
      hn::Max(hn::NegMulAdd(variance, hn::Set(d, 1.0F + kSquareError), squared), hn::Zero(d)));
}

// The variance of a random node along an axis, in squared edges.
template <class V>
HWY_INLINE V Variance(V t) {
  return hn::NegMulAdd(t, t, t);
}

class FieldLookup {
 public:
  explicit FieldLookup(const DistanceField& field)
      : field_(field), diagonal_(field.bounds().diagonal().norm()) {}

  // The finest grid that holds a sphere, and whose cells are not much smaller; else the coarsest.
  const DistanceField::Level& LevelAt(const float* center, float radius) const {
    for (const DistanceField::Level& level : field_.levels()) {
      bool is_inside = radius <= kCellsPerRadius * level.cell;
      for (int i = 0; i < 3; ++i) {
        const float from_low = center[i] - level.low[i];
        const float extent = static_cast<float>(level.size[i] - 1) * level.cell;
        is_inside = is_inside && from_low >= radius && from_low + radius <= extent;
      }
      if (is_inside) return level;
    }
    return field_.levels().back();
  }

  // [m] The distances of places from the box about the solid.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V FromBounds(D d, V x, V y, V z) const {
    const Eigen::AlignedBox3f& box = field_.bounds();
    const auto along = [&](int axis, V v) {
      return lanes::IntervalDistance(d, hn::Set(d, box.min()[axis]), hn::Set(d, box.max()[axis]),
                                     v);
    };
    return lanes::Norm(along(0, x), along(1, y), along(2, z));
  }

  // Lower bounds [m] of the distances of places.
  // @param from_bounds  by FromBounds()
  // @param upper        receives upper bounds; kFarAway where none is known
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V Distance(D d, const DistanceField::Level& level, V x, V y, V z, V from_bounds,
                        V* upper) const {
    const hn::RebindToSigned<D> di;
    const V gx = GridCoordinate(d, level, 0, x), gy = GridCoordinate(d, level, 1, y),
            gz = GridCoordinate(d, level, 2, z);
    // Written so that NaN is in no cell.
    const auto is_in = hn::And(hn::And(IsInGrid(d, level, 0, gx), IsInGrid(d, level, 1, gy)),
                               IsInGrid(d, level, 2, gz));
    const auto ix = hn::ConvertTo(di, hn::IfThenElseZero(is_in, gx)),
               iy = hn::ConvertTo(di, hn::IfThenElseZero(is_in, gy)),
               iz = hn::ConvertTo(di, hn::IfThenElseZero(is_in, gz));
    const V tx = hn::Sub(hn::IfThenElseZero(is_in, gx), hn::ConvertTo(d, ix)),
            ty = hn::Sub(hn::IfThenElseZero(is_in, gy), hn::ConvertTo(d, iy)),
            tz = hn::Sub(hn::IfThenElseZero(is_in, gz), hn::ConvertTo(d, iz));
    const std::int32_t row = level.size[0], layer = row * level.size[1];
    const auto at =
        hn::Add(ix, hn::Add(hn::Mul(iy, hn::Set(di, row)), hn::Mul(iz, hn::Set(di, layer))));
    const std::uint16_t* values = field_.values().data() + level.first;
    V most = hn::Zero(d);
    const auto along_x = [&](std::int32_t offset) {
      return Edge(d, values, hn::Add(at, hn::Set(di, offset)), tx, &most);
    };
    const V near = Mix(ty, along_x(0), along_x(row));
    const V far = Mix(ty, along_x(layer), along_x(layer + row));
    const V interpolated =
        hn::Mul(Mix(tz, near, far), hn::Set(d, DistanceField::kStep * DistanceField::kStep));
    const V variance = hn::Mul(hn::Set(d, level.cell * level.cell),
                               hn::Add(Variance(tx), hn::Add(Variance(ty), Variance(tz))));
    const V lower = hn::Sub(LessVariance(d, interpolated, variance), hn::Set(d, kPlaceError));
    const auto is_known =
        hn::And(is_in, hn::Lt(most, hn::Set(d, static_cast<float>(DistanceField::kFar))));
    const float slack = level.cell * (kHalfDiagonal + 1.0F / DistanceField::kSlackParts) +
                        DistanceField::kStep + kPlaceError;
    *upper = hn::IfThenElse(is_known, hn::Add(hn::Sqrt(interpolated), hn::Set(d, slack)),
                            hn::Add(from_bounds, hn::Set(d, diagonal_)));
    return hn::Max(hn::IfThenElseZero(is_in, lower), from_bounds);
  }

  // [m] No surface and no place inside is nearer to a place; not positive: unknown.
  // @param from_bounds  by FromBounds()
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V OutsideRadius(D d, V x, V y, V z, V from_bounds) const {
    const hn::RebindToSigned<D> di;
    const V by_bounds = hn::Sub(from_bounds, hn::Set(d, kPlaceError));
    // No ball about a node is larger; and of a closed solid only the side of a place is asked.
    constexpr float kLargest = 255.0F * DistanceField::kOutsideStep;
    if (hn::AllTrue(d, hn::Gt(by_bounds, hn::Set(d, field_.is_closed() ? 0.0F : kLargest)))) {
      return by_bounds;
    }
    const DistanceField::Level& level = field_.levels().front();
    const V gx = GridCoordinate(d, level, 0, x), gy = GridCoordinate(d, level, 1, y),
            gz = GridCoordinate(d, level, 2, z);
    const auto is_in = hn::And(hn::And(IsInGrid(d, level, 0, gx), IsInGrid(d, level, 1, gy)),
                               IsInGrid(d, level, 2, gz));
    const auto nearest = [&](V g) { return hn::NearestInt(hn::IfThenElseZero(is_in, g)); };
    const auto ix = nearest(gx), iy = nearest(gy), iz = nearest(gz);
    const std::int32_t row = level.size[0], layer = row * level.size[1];
    const auto at =
        hn::Add(ix, hn::Add(hn::Mul(iy, hn::Set(di, row)), hn::Mul(iz, hn::Set(di, layer))));
    const auto bytes =
        hn::GatherOffset(di, reinterpret_cast<const std::int32_t*>(field_.outside().data()), at);
    const V radius = hn::Mul(hn::ConvertTo(d, hn::And(bytes, hn::Set(di, 0xFF))),
                             hn::Set(d, DistanceField::kOutsideStep));
    const V from_node =
        hn::Mul(lanes::Norm(hn::Sub(gx, hn::ConvertTo(d, ix)), hn::Sub(gy, hn::ConvertTo(d, iy)),
                            hn::Sub(gz, hn::ConvertTo(d, iz))),
                hn::Set(d, level.cell));
    const V by_node = hn::Sub(hn::Sub(radius, from_node), hn::Set(d, kPlaceError));
    return hn::Max(hn::IfThenElseZero(is_in, by_node), by_bounds);
  }

  // A node of the grid of depths tells this of places.
  template <class D, class V = hn::Vec<D>>
  struct ByNode {
    V x, y, z;  // [m] from the node's surface point to the place
    V ball;     // [m] no surface and no place inside is nearer to the place
  };

  // By the nodes nearest to the places. The grid must have nodes.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE ByNode<D> ByNearestNode(D d, V x, V y, V z) const {
    const auto at = [&](int axis, V v) {
      return hn::NearestInt(DepthCoordinate(d, axis, v, field_.depths().size[axis] - 1));
    };
    return LookUp(d, x, y, z, at(0, x), at(1, y), at(2, z));
  }

  // By the eight nodes about the places.
  // @param ball  as ByNode
  // @returns [m] the least distances of the places from the nodes' surface points
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V ByEightNodes(D d, V x, V y, V z, V* ball) const {
    const hn::RebindToSigned<D> di;
    const auto low = [&](int axis, V v) {
      return hn::ConvertTo(di, DepthCoordinate(d, axis, v, field_.depths().size[axis] - 2));
    };
    const auto ix = low(0, x), iy = low(1, y), iz = low(2, z), one = hn::Set(di, 1);
    auto least_sq = hn::Set(d, kFarAway);
    *ball = hn::Zero(d);
    for (const auto& jx : {ix, hn::Add(ix, one)}) {
      for (const auto& jy : {iy, hn::Add(iy, one)}) {
        for (const auto& jz : {iz, hn::Add(iz, one)}) {
          const auto v = LookUp(d, x, y, z, jx, jy, jz);
          *ball = hn::Max(*ball, v.ball);
          least_sq =
              hn::Min(least_sq, hn::MulAdd(v.x, v.x, hn::MulAdd(v.y, v.y, hn::Mul(v.z, v.z))));
        }
      }
    }
    return hn::Sqrt(least_sq);
  }

  // [m] How much too short those distances may be.
  float surface_error() const { return field_.surface_step() + kPlaceError; }

 private:
  // Larger spheres are not looked up in small cells: their radius is the larger error.
  static constexpr float kCellsPerRadius = 8.0F;
  static constexpr float kHalfDiagonal = 0.8661F;

  template <class D, class V = hn::Vec<D>>
  static HWY_INLINE V GridCoordinate(D d, const DistanceField::Level& level, int axis, V x) {
    return hn::Mul(hn::Sub(x, hn::Set(d, level.low[axis])), hn::Set(d, level.per_cell));
  }
  template <class D, class V = hn::Vec<D>>
  static HWY_INLINE hn::Mask<D> IsInGrid(D d, const DistanceField::Level& level, int axis, V g) {
    return hn::And(hn::Ge(g, hn::Zero(d)),
                   hn::Lt(g, hn::Set(d, static_cast<float>(level.size[axis] - 1))));
  }
  template <class V>
  static HWY_INLINE V Mix(V t, V a, V b) {
    return hn::MulAdd(t, hn::Sub(b, a), a);
  }

  // Interpolates along x between two nodes. The pair is read at once.
  template <class D, class VI, class V = hn::Vec<D>>
  static HWY_INLINE V Edge(D d, const std::uint16_t* values, VI at, V t, V* most) {
    const hn::RebindToSigned<D> di;
    const hn::RebindToUnsigned<D> du;
    const auto pair =
        hn::GatherOffset(di, reinterpret_cast<const std::int32_t*>(values), hn::ShiftLeft<1>(at));
    const V a = hn::ConvertTo(d, hn::And(pair, hn::Set(di, 0xFFFF)));
    const V b = hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<16>(hn::BitCast(du, pair))));
    *most = hn::Max(*most, hn::Max(a, b));
    return Mix(t, hn::Mul(a, a), hn::Mul(b, b));
  }

  // Returns a coordinate in cells of the grid of depths, at most `last`. NaN is in cell 0.
  template <class D, class V = hn::Vec<D>>
  HWY_INLINE V DepthCoordinate(D d, int axis, V x, std::int32_t last) const {
    const V zero = hn::Zero(d), most = hn::Set(d, static_cast<float>(last));
    const V g = hn::Min(hn::Max(GridCoordinate(d, field_.depths(), axis, x), zero), most);
    return hn::IfThenElseZero(hn::And(hn::Ge(g, zero), hn::Le(g, most)), g);
  }

  template <class D, class VI, class V = hn::Vec<D>>
  HWY_INLINE ByNode<D> LookUp(D d, V x, V y, V z, VI ix, VI iy, VI iz) const {
    const hn::RebindToSigned<D> di;
    const hn::RebindToUnsigned<D> du;
    const DistanceField::Level& level = field_.depths();
    const std::int32_t row = level.size[0], layer = row * level.size[1];
    const auto at =
        hn::Add(ix, hn::Add(hn::Mul(iy, hn::Set(di, row)), hn::Mul(iz, hn::Set(di, layer))));
    const auto gather = [&](const std::vector<std::uint32_t>& values) {
      return hn::GatherIndex(di, reinterpret_cast<const std::int32_t*>(values.data()), at);
    };
    const auto xy = gather(field_.surface_xy()), z_ball = gather(field_.surface_z_ball());
    const auto low_half = [](VI v) { return hn::ShiftRight<16>(hn::ShiftLeft<16>(v)); };
    const auto from_node = [&](int axis, V v, VI i) {
      const V from_low = hn::Sub(v, hn::Set(d, level.low[axis]));
      return hn::NegMulAdd(hn::ConvertTo(d, i), hn::Set(d, level.cell), from_low);
    };
    const V dx = from_node(0, x, ix), dy = from_node(1, y, iy), dz = from_node(2, z, iz);
    const auto from_surface = [&](V v, VI offset) {
      return hn::NegMulAdd(hn::ConvertTo(d, offset), hn::Set(d, field_.surface_step()), v);
    };
    const V radius =
        hn::Mul(hn::ConvertTo(d, hn::BitCast(di, hn::ShiftRight<16>(hn::BitCast(du, z_ball)))),
                hn::Set(d, DistanceField::kBallStep));
    const V ball = hn::Sub(hn::Sub(radius, lanes::Norm(dx, dy, dz)), hn::Set(d, kPlaceError));
    return {from_surface(dx, low_half(xy)), from_surface(dy, hn::ShiftRight<16>(xy)),
            from_surface(dz, low_half(z_ball)), ball};
  }

  const DistanceField& field_;
  const float diagonal_;  // [m] of the box about the solid
};

}  // namespace field_lookup
}  // namespace HWY_NAMESPACE
}  // namespace ist
HWY_AFTER_NAMESPACE();

#endif  // IST_PROXIMITY_FIELD_LOOKUP_INL_H
