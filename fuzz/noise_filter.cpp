// The noise filter: points stay where they are and in their order; those that it drops become NaN,
// as many as it says, and only where they have too few neighbours within the range.
//
// Covers: src/cloud/noise/noise_filter.cpp
// Longest input: 600

#include "internal/cloud/noise_filter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "cloud/format/point_reader.h"
#include "support/byte_reader.h"
#include "support/check.h"

namespace {

using ist::fuzz::ByteReader;

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kLargestRange = 1e9;  // [m] farther points are as good as infinite

// Neighbours of point i within the radius, itself not counted.
int neighbours(const std::vector<double>& xyz, std::size_t i, double radius, double max_range) {
  int count = 0;
  const Eigen::Map<const Eigen::Matrix3Xd> points(xyz.data(), 3,
                                                  static_cast<Eigen::Index>(xyz.size() / 3));
  for (Eigen::Index k = 0; k < points.cols(); ++k) {
    if (k == static_cast<Eigen::Index>(i) || !(points.col(k).norm() <= max_range)) continue;
    if ((points.col(k) - points.col(static_cast<Eigen::Index>(i))).norm() <= radius) ++count;
  }
  return count;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  ByteReader in(data, size);
  ist::NoiseFilterConfig config;
  config.radius = in.between(1e-3, 0.5);
  config.neighbors = 1 + static_cast<int>(in.below(6));
  const double max_range = in.flag() ? kInf : in.between(0.1, 10.0);
  std::vector<double> xyz;
  while (in.left() > 0 && xyz.size() < 300) {
    for (int k = 0; k < 3; ++k) xyz.push_back(in.number(2.0));
  }
  if (xyz.empty()) return 0;
  ist::RawCloud raw;
  raw.data = reinterpret_cast<const std::uint8_t*>(xyz.data());
  raw.width = xyz.size() / 3;
  raw.height = 1;
  raw.point_step = 24;
  raw.row_step = 24 * raw.width;
  raw.y = 8;
  raw.z = 16;
  raw.is_double = true;
  std::uint32_t dropped = 0;
  ist::NoiseFilter filter(config);
  const ist::RawCloud kept = filter.run(raw, max_range, &dropped);
  FUZZ_CHECK(kept.size() == raw.size(), "%zu points of %zu", kept.size(), raw.size());
  std::uint32_t now_nan = 0;
  for (std::size_t i = 0; i < raw.size(); ++i) {
    const Eigen::Vector3d before = ist::point_at(raw, 0, i), after = ist::point_at(kept, 0, i);
    if (before.allFinite() && after.array().isNaN().all()) {
      ++now_nan;
      const int count = neighbours(xyz, i, (1.0 - 1e-12) * config.radius, max_range);
      FUZZ_CHECK(before.norm() <= max_range && count < config.neighbors,
                 "point %zu with %d neighbours is dropped", i, count);
      continue;
    }
    if (before.allFinite() && before.norm() <= (1.0 - 1e-12) * std::min(max_range, kLargestRange)) {
      const int count = neighbours(xyz, i, (1.0 + 1e-12) * config.radius, max_range);
      FUZZ_CHECK(count >= config.neighbors, "point %zu with %d neighbours is kept", i, count);
    }
    for (int k = 0; k < 3; ++k) {
      FUZZ_CHECK(after[k] == before[k] || (std::isnan(after[k]) && std::isnan(before[k])),
                 "point %zu is moved", i);
    }
  }
  FUZZ_CHECK(now_nan == dropped, "%u dropped, not %u", dropped, now_nan);
  return 0;
}
