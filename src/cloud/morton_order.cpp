#include "cloud/morton_order.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

namespace ist {
namespace {

// A cell with more points than this is ordered by a grid of its own.
constexpr std::size_t kCrowded = 64;
// Cells are so large that a surface puts about this many points into one.
constexpr std::size_t kPointsPerCell = 8;
constexpr int kMaxBitsPerAxis = 10;  // three times that fits the key
constexpr int kDigitBits = 12;       // of the radix sort; two of them make the usual 24-bit key

// The lowest ten bits of v, each followed by two zeros.
inline std::uint32_t spread(std::uint32_t v) {
  v = (v | v << 16) & 0x030000FFU;
  v = (v | v << 8) & 0x0300F00FU;
  v = (v | v << 4) & 0x030C30C3U;
  v = (v | v << 2) & 0x09249249U;
  return v;
}

int bits_per_axis_for(std::size_t n) {
  int bits = 1;
  while (bits < kMaxBitsPerAxis && (n >> (2 * bits)) > kPointsPerCell) ++bits;
  return bits;
}

struct Interval {
  float min, max;
};

// Lane by lane, because the compiler may not reorder a plain minimum of floats.
template <typename Value>
Interval interval_of(std::size_t n, const Value& value) {
  constexpr std::size_t kLanes = 16;
  std::array<float, kLanes> low, high;
  low.fill(value(0));
  high.fill(value(0));
  std::size_t i = 0;
  for (; i + kLanes <= n; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float v = value(i + k);
      low[k] = v < low[k] ? v : low[k];
      high[k] = v > high[k] ? v : high[k];
    }
  }
  for (; i < n; ++i) {
    low[0] = std::min(low[0], value(i));
    high[0] = std::max(high[0], value(i));
  }
  return {*std::min_element(low.begin(), low.end()), *std::max_element(high.begin(), high.end())};
}

// A grid of cubes over the bounds of some points.
class Grid {
 public:
  Grid(const Interval& x, const Interval& y, const Interval& z, int bits_per_axis)
      : x_(x.min), y_(y.min), z_(z.min), last_cell_((1 << bits_per_axis) - 1) {
    const float extent = std::max({x.max - x.min, y.max - y.min, z.max - z.min});
    scale_ = static_cast<float>(1 << bits_per_axis) / extent;
  }

  // False where all points are one, or as good as one: there is nothing to order.
  bool separates() const { return std::isfinite(scale_) && scale_ > 0.0F; }

  std::uint32_t key(float x, float y, float z) const {
    return spread(cell(x - x_)) | spread(cell(y - y_)) << 1 | spread(cell(z - z_)) << 2;
  }

 private:
  std::uint32_t cell(float offset) const {
    const auto i = static_cast<std::int32_t>(offset * scale_);
    return static_cast<std::uint32_t>(i < last_cell_ ? i : last_cell_);
  }

  float x_, y_, z_, scale_;
  std::int32_t last_cell_;
};

std::uint32_t key_of(std::uint64_t record) { return static_cast<std::uint32_t>(record >> 32); }
std::uint32_t point_of(std::uint64_t record) { return static_cast<std::uint32_t>(record); }

}  // namespace

void MortonOrder::sort(const float* x, const float* y, const float* z, std::size_t n,
                       std::vector<std::uint32_t>* order) {
  x_ = x;
  y_ = y;
  z_ = z;
  records_.resize(n);
  scratch_.resize(n);
  order->resize(n);
  const int bits = bits_per_axis_for(n);
  if (n > 1) {
    const Grid grid(interval_of(n, [=](std::size_t i) { return x[i]; }),
                    interval_of(n, [=](std::size_t i) { return y[i]; }),
                    interval_of(n, [=](std::size_t i) { return z[i]; }), bits);
    if (!grid.separates()) {
      std::iota(order->begin(), order->end(), 0U);
      return;
    }
    for (std::size_t i = 0; i < n; ++i) {
      records_[i] = static_cast<Record>(grid.key(x[i], y[i], z[i])) << 32 | i;
    }
    radix_sort(0, n, 3 * bits);
    refine_crowded_cells(0, n);
  } else if (n == 1) {
    records_[0] = 0;
  }
  for (std::size_t i = 0; i < n; ++i) (*order)[i] = point_of(records_[i]);
}

void MortonOrder::refine_crowded_cells(std::size_t first, std::size_t last) {
  // A run of more than two strides holds two of the samples.
  constexpr std::size_t kStride = kCrowded / 2;
  for (std::size_t i = first, done = first; i + kStride < last;) {
    const std::uint32_t key = key_of(records_[i]);
    if (key_of(records_[i + kStride]) != key) {
      i += kStride;
      continue;
    }
    std::size_t begin = i, end = i + kStride + 1;
    while (begin > done && key_of(records_[begin - 1]) == key) --begin;
    while (end < last && key_of(records_[end]) == key) ++end;
    if (end - begin > kCrowded) sort_cell(begin, end);
    i = done = end;
  }
}

void MortonOrder::sort_cell(std::size_t first, std::size_t last) {
  const auto coordinate = [this, first](const float* values) {
    return [this, first, values](std::size_t i) { return values[point_of(records_[first + i])]; };
  };
  const std::size_t n = last - first;
  const int bits = bits_per_axis_for(n);
  const Grid grid(interval_of(n, coordinate(x_)), interval_of(n, coordinate(y_)),
                  interval_of(n, coordinate(z_)), bits);
  if (!grid.separates()) return;
  for (std::size_t i = first; i < last; ++i) {
    const std::uint32_t point = point_of(records_[i]);
    records_[i] = static_cast<Record>(grid.key(x_[point], y_[point], z_[point])) << 32 | point;
  }
  radix_sort(first, last, 3 * bits);
  refine_crowded_cells(first, last);
}

void MortonOrder::radix_sort(std::size_t first, std::size_t last, int key_bits) {
  for (int done = 0; done < key_bits; done += kDigitBits) {
    const int shift = 32 + done;
    const std::size_t buckets = std::size_t{1} << std::min(kDigitBits, key_bits - done);
    const Record mask = buckets - 1;
    histogram_.assign(buckets, 0);
    for (std::size_t i = first; i < last; ++i) ++histogram_[records_[i] >> shift & mask];
    std::uint32_t position = static_cast<std::uint32_t>(first);
    for (std::uint32_t& count : histogram_) {
      const std::uint32_t next = position + count;
      count = position;
      position = next;
    }
    for (std::size_t i = first; i < last; ++i) {
      scratch_[histogram_[records_[i] >> shift & mask]++] = records_[i];
    }
    if (first == 0 && last == records_.size()) {
      records_.swap(scratch_);
    } else {
      std::copy(scratch_.begin() + static_cast<std::ptrdiff_t>(first),
                scratch_.begin() + static_cast<std::ptrdiff_t>(last),
                records_.begin() + static_cast<std::ptrdiff_t>(first));
    }
  }
}

}  // namespace ist
