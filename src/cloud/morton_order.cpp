#include "cloud/morton_order.h"

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>

namespace ist {
namespace {

// A cell with more points than this is ordered by a grid of its own.
constexpr std::size_t kCrowded = 64;
// Cells are so large that a surface puts at most about this many points into one.
constexpr std::size_t kPointsPerCell = 16;
constexpr int kMaxBits = 4;  // per axis and grid; three times that are one digit

using Four = Eigen::Array4f;

Eigen::Map<const Four, Eigen::Aligned16> four(const CloudPoint& point) {
  return Eigen::Map<const Four, Eigen::Aligned16>(&point.x);
}

// No more cells than points, which are counted, too.
int bits_per_axis_for(std::size_t n) {
  int bits = 1;
  while (bits < kMaxBits && n >> (2 * bits) > kPointsPerCell && n >> (3 * bits + 3) > 0) ++bits;
  return bits;
}

// The bits of a number below 2^kMaxBits, each followed by two zeros.
constexpr std::array<std::uint16_t, 1 << kMaxBits> kSpread = [] {
  std::array<std::uint16_t, 1 << kMaxBits> spread{};
  for (unsigned v = 0; v < spread.size(); ++v) {
    unsigned bits = 0;
    for (unsigned i = 0; i < kMaxBits; ++i) bits |= (v >> i & 1U) << (3 * i);
    spread[v] = static_cast<std::uint16_t>(bits);
  }
  return spread;
}();

// A grid of cubes over the bounds of some points.
class Grid {
 public:
  Grid(const CloudPoint* points, std::size_t n, int bits_per_axis)
      : last_cell_(static_cast<float>((1 << bits_per_axis) - 1)) {
    // The fourth number is an identity: least and greatest of it mean nothing, and harm nobody.
    Four max = four(points[0]);
    min_ = max;
    for (std::size_t i = 1; i < n; ++i) {
      const Four p = four(points[i]);
      min_ = min_.min(p);
      max = max.max(p);
    }
    const float extent = (max - min_).head<3>().maxCoeff();
    scale_ = static_cast<float>(1 << bits_per_axis) / extent;
  }

  // False where all points are one, or as good as one: there is nothing to order.
  bool separates() const { return std::isfinite(scale_) && scale_ > 0.0F; }

  std::uint16_t key(const CloudPoint& p) const {
    return static_cast<std::uint16_t>(spread(p.x - min_.x()) | spread(p.y - min_.y()) << 1 |
                                      spread(p.z - min_.z()) << 2);
  }

 private:
  unsigned spread(float offset) const {
    return kSpread[static_cast<std::size_t>(
        static_cast<std::int32_t>(std::min(offset * scale_, last_cell_)))];
  }

  Four min_;
  float scale_, last_cell_;
};

}  // namespace

const CloudPoint* MortonOrder::sort(const CloudPoint* points, std::size_t n) {
  if (sorted_.size() < n) {
    sorted_.resize(n);
    keys_.resize(n);
  }
  cell_ends_.clear();
  depth_ = 0;
  const std::vector<std::uint32_t>& ends = pass(points, n, sorted_.data());
  for (const std::uint32_t end : ends) {
    if (cell_ends_.empty() ? end > 0 : end > cell_ends_.back()) cell_ends_.push_back(end);
  }
  if (ends.empty()) {
    std::copy_n(points, n, sorted_.data());
    if (n > 0) cell_ends_.push_back(n);
  }
  sort_cells(ends, sorted_.data());
  return sorted_.data();
}

const std::vector<std::uint32_t>& MortonOrder::pass(const CloudPoint* from, std::size_t n,
                                                    CloudPoint* to) {
  if (ends_.size() <= depth_) ends_.resize(depth_ + 1);
  std::vector<std::uint32_t>& ends = ends_[depth_];
  ends.clear();
  if (n < 2) return ends;
  const int bits = bits_per_axis_for(n);
  const Grid grid(from, n, bits);
  if (!grid.separates()) return ends;
  ends.assign(std::size_t{1} << (3 * bits), 0U);
  std::uint32_t* at = ends.data();
  std::uint16_t* keys = keys_.data();
  for (std::size_t i = 0; i < n; ++i) {
    keys[i] = grid.key(from[i]);
    ++at[keys[i]];
  }
  std::uint32_t begin = 0;
  for (std::uint32_t& end : ends) {
    const std::uint32_t count = end;
    end = begin;  // grows with every point that is put there
    begin += count;
  }
  for (std::size_t i = 0; i < n; ++i) to[at[keys[i]]++] = from[i];
  return ends;
}

// Orders what crowded cells hold.
void MortonOrder::sort_cells(const std::vector<std::uint32_t>& ends, CloudPoint* points) {
  ++depth_;
  std::uint32_t begin = 0;
  for (std::size_t cell = 0; cell < ends.size(); ++cell) {
    const std::uint32_t end = ends[cell];
    if (end - begin > kCrowded) {
      const std::size_t n = end - begin;
      if (cell_.size() < n) cell_.resize(n);
      std::copy_n(points + begin, n, cell_.data());
      sort_cells(pass(cell_.data(), n, points + begin), points + begin);
    }
    begin = end;
  }
  --depth_;
}

}  // namespace ist
