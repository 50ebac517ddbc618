#include "proximity/coherence/node_bounds.h"

#include "internal/geometry/float_rounding.h"

namespace ist {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
// [m] After such a displacement the stored bounds are discarded: float still resolves them.
constexpr double kMaxDisplacement = 0.1;

float stored(double bound, double displacement) {
  return bound < kInfinity ? round_down(bound + displacement)
                           : std::numeric_limits<float>::infinity();
}

}  // namespace

NodeBounds::NodeBounds(const LinkModel& link)
    : keys_(kNodes + kTiles),
      floors_(kNodes + kTiles),
      outsides_(link.solid.is_closed() ? 0 : kNodes + kTiles) {}

// Indices share the table.
std::size_t NodeBounds::slot(std::int32_t child) const {
  const std::size_t shift = 389 * indices_[now_].id;
  return child >= 0 ? (static_cast<std::size_t>(child) + shift) % kNodes
                    : kNodes + (static_cast<std::size_t>(~child) + shift) % kTiles;
}

void NodeBounds::start(Index* index) {
  index->id = ++last_id_;
  index->displacement = 0.0;
}

void NodeBounds::begin(std::uint64_t build_id, const Eigen::Isometry3d& X_OL,
                       const DisplacementBound& displacement) {
  std::size_t oldest = 0;
  for (now_ = 0; now_ < kIndices && indices_[now_].build_id != build_id; ++now_) {
    if (indices_[now_].last_used < indices_[oldest].last_used) oldest = now_;
  }
  const bool is_known = now_ < kIndices;
  if (!is_known) now_ = oldest;
  Index& index = indices_[now_];
  last_step_ = is_known ? displacement.between(index.X_OL, X_OL) : kInfinity;
  index.displacement += last_step_;
  // Written so that a displacement that is NaN discards everything.
  if (!(index.displacement < kMaxDisplacement)) start(&index);
  index.build_id = build_id;
  index.X_OL = X_OL;
  index.last_used = ++uses_;
}

bool NodeBounds::load(std::int32_t child, ChildBounds* bounds) const {
  const std::size_t at = slot(child);
  if (keys_[at].index != indices_[now_].id || keys_[at].child != child) return false;
  const double displacement = indices_[now_].displacement;
  for (std::size_t k = 0; k < kBoxWidth; ++k) {
    bounds->floor[k] = static_cast<double>(floors_[at][k]) - displacement;
  }
  if (outsides_.empty()) {
    bounds->outside.fill(kInfinity);
    return true;
  }
  for (std::size_t k = 0; k < kBoxWidth; ++k) {
    bounds->outside[k] = static_cast<double>(outsides_[at][k]) - displacement;
  }
  return true;
}

void NodeBounds::store(std::int32_t child, const ChildBounds& bounds) {
  const std::size_t at = slot(child);
  keys_[at] = {indices_[now_].id, child};
  const double displacement = indices_[now_].displacement;
  for (std::size_t k = 0; k < kBoxWidth; ++k) {
    floors_[at][k] = stored(bounds.floor[k], displacement);
  }
  if (outsides_.empty()) return;
  for (std::size_t k = 0; k < kBoxWidth; ++k) {
    outsides_[at][k] = stored(bounds.outside[k], displacement);
  }
}

void NodeBounds::forget() {
  for (Index& index : indices_) index.build_id = 0;
}

}  // namespace ist
