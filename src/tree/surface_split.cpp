#include <algorithm>
#include <limits>

#include "ist_proximity/tree/inner_sphere_tree.h"
#include "tree/partition.h"

namespace ist {
namespace {

constexpr auto kWidth = static_cast<std::uint32_t>(kSphereWidth);

void extend(Eigen::AlignedBox3d* box, const InnerSphere& sphere) {
  box->extend(Eigen::Vector3d(sphere.center.array() - sphere.cover_radius));
  box->extend(Eigen::Vector3d(sphere.center.array() + sphere.cover_radius));
}

double area(const Eigen::AlignedBox3d& box) {
  const Eigen::Vector3d s = box.sizes();
  return 2.0 * (s.x() * s.y() + s.y() * s.z() + s.z() * s.x());
}

double leaves(std::uint32_t spheres) {
  const std::uint32_t count = (spheres + kWidth - 1) / kWidth;
  return static_cast<double>(count);
}

void sort_along(int axis, const SphereRange& range, SphereOrder* order) {
  const auto begin = order->indices.begin();
  std::sort(begin + range.first, begin + range.second, [&](std::uint32_t a, std::uint32_t b) {
    const double ca = (*order->spheres)[a].center[axis], cb = (*order->spheres)[b].center[axis];
    return ca < cb || (ca == cb && a < b);
  });
}

// Finds the cheapest of all splits along all axes and sorts the range by its axis.
std::uint32_t best_split(const SphereRange& range, SphereOrder* order) {
  double least = std::numeric_limits<double>::infinity();
  int best_axis = 0;
  std::uint32_t best = range.first + size(range) / 2;
  std::vector<double> upper(size(range));
  for (int axis = 0; axis < 3; ++axis) {
    sort_along(axis, range, order);
    Eigen::AlignedBox3d box;
    for (std::uint32_t i = range.second; i-- > range.first;) {
      extend(&box, (*order)[i]);
      upper[i - range.first] = area(box) * leaves(range.second - i);
    }
    box.setEmpty();
    for (std::uint32_t i = range.first + 1; i < range.second; ++i) {
      extend(&box, (*order)[i - 1]);
      const double cost = area(box) * leaves(i - range.first) + upper[i - range.first];
      if (cost >= least) continue;
      least = cost;
      best_axis = axis;
      best = i;
    }
  }
  sort_along(best_axis, range, order);
  return best;
}

}  // namespace

// The group with the largest surface area that is no leaf yet is divided first: queries meet it
// most often.
std::vector<SphereRange> split_by_surface(const SphereRange& range, SphereOrder* order) {
  const auto weight = [order](const SphereRange& group) {
    if (size(group) <= kWidth) return -1.0;
    Eigen::AlignedBox3d box;
    for (std::uint32_t i = group.first; i < group.second; ++i) extend(&box, (*order)[i]);
    return area(box);
  };
  std::vector<SphereRange> groups{range};
  while (groups.size() < kWidth) {
    const auto next = std::max_element(
        groups.begin(), groups.end(),
        [&](const SphereRange& a, const SphereRange& b) { return weight(a) < weight(b); });
    if (size(*next) <= kWidth) break;
    const std::uint32_t middle = best_split(*next, order);
    const SphereRange upper{middle, next->second};
    next->second = middle;
    groups.insert(next + 1, upper);
  }
  return groups;
}

}  // namespace ist
