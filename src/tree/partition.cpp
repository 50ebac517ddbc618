#include "tree/partition.h"

#include <algorithm>

#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::uint32_t>(kSphereWidth);

// Splits at the median along the longest axis of the centres' box.
std::uint32_t halve(const SphereRange& range, SphereOrder* order) {
  Eigen::AlignedBox3d box;
  for (std::uint32_t i = range.first; i < range.second; ++i) box.extend((*order)[i].center);
  Eigen::Index axis;
  box.sizes().maxCoeff(&axis);
  const std::uint32_t middle = range.first + size(range) / 2;
  const auto begin = order->indices.begin();
  std::nth_element(begin + range.first, begin + middle, begin + range.second,
                   [&](std::uint32_t a, std::uint32_t b) {
                     const double ca = (*order->spheres)[a].center[axis];
                     const double cb = (*order->spheres)[b].center[axis];
                     return ca < cb || (ca == cb && a < b);
                   });
  return middle;
}

}  // namespace

std::vector<SphereRange> split_at_medians(const SphereRange& range, SphereOrder* order) {
  std::vector<SphereRange> groups{range};
  while (groups.size() < kWidth) {
    const auto largest = std::max_element(
        groups.begin(), groups.end(),
        [](const SphereRange& a, const SphereRange& b) { return size(a) < size(b); });
    if (size(*largest) <= kWidth) break;
    const std::uint32_t middle = halve(*largest, order);
    const SphereRange upper{middle, largest->second};
    largest->second = middle;
    groups.insert(largest + 1, upper);
  }
  return groups;
}

}  // namespace ist
