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

int median_levels(std::uint32_t count) {
  int levels = 1;
  for (; count > kWidth; count = (count + kWidth - 1) / kWidth) ++levels;
  return levels;
}

// The group with the most spheres is halved until there are enough groups.
std::vector<SphereRange> split_at_medians(const SphereRange& range, std::size_t most,
                                          SphereOrder* order) {
  std::vector<SphereRange> groups{range};
  while (groups.size() < most) {
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

std::vector<SphereRange> partition(const TreeConfig& config, const SphereRange& range,
                                   int levels_left, SphereOrder* order) {
  std::vector<SphereRange> groups;
  if (config.split == TreeSplit::kSurfaceArea) groups = split_by_surface(range, order);
  if (config.split == TreeSplit::kNeuralGas) {
    groups = split_by_neural_gas(range, config.magnification, order);
  }
  std::uint32_t largest = 0;
  for (const SphereRange& group : groups) largest = std::max(largest, size(group));
  // Uneven groups make a deep tree. They are accepted as long as median splits could complete it.
  const bool fits = groups.size() > 1 && median_levels(largest) <= levels_left;
  return fits ? groups : split_at_medians(range, kWidth, order);
}

}  // namespace ist
