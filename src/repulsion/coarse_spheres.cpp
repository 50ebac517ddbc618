#include "repulsion/coarse_spheres.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <limits>

#include "internal/bvh/box_node.h"

namespace ist {
namespace {

SphereGroup group_of(const InnerSphere* spheres, std::size_t count) {
  SphereGroup group;
  Eigen::AlignedBox3d box;
  for (std::size_t k = 0; k < static_cast<std::size_t>(kSphereGroupWidth); ++k) {
    const bool used = k < count;
    if (used) box.extend(spheres[k].center);
    group.x[k] = used ? static_cast<float>(spheres[k].center.x()) : kFarAway;
    group.y[k] = used ? static_cast<float>(spheres[k].center.y()) : kFarAway;
    group.z[k] = used ? static_cast<float>(spheres[k].center.z()) : kFarAway;
    group.radius[k] = used ? static_cast<float>(spheres[k].radius) : 0.0F;
  }
  double bound = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    bound = std::max(bound, (spheres[k].center - box.center()).norm() + spheres[k].radius);
  }
  constexpr double kRounding = 1e-5;  // [m] of float coordinates, and more
  group.bound_radius = static_cast<float>(bound + kRounding);
  for (int i = 0; i < 3; ++i) group.bound_center[i] = static_cast<float>(box.center()[i]);
  return group;
}

// Halves across the longest side, whole groups in the first half, until each is one group.
void split(InnerSphere* begin, InnerSphere* end, std::vector<SphereGroup>* groups) {
  const auto count = static_cast<std::size_t>(end - begin);
  constexpr auto kWidth = static_cast<std::size_t>(kSphereGroupWidth);
  if (count <= kWidth) {
    if (count > 0) groups->push_back(group_of(begin, count));
    return;
  }
  Eigen::AlignedBox3d box;
  for (const InnerSphere* sphere = begin; sphere != end; ++sphere) box.extend(sphere->center);
  Eigen::Index axis;
  box.sizes().maxCoeff(&axis);
  InnerSphere* middle = begin + (count / 2 + kWidth - 1) / kWidth * kWidth;
  std::nth_element(begin, middle, end, [axis](const InnerSphere& a, const InnerSphere& b) {
    return a.center[axis] < b.center[axis];
  });
  split(begin, middle, groups);
  split(middle, end, groups);
}

}  // namespace

std::vector<SphereGroup> group_spheres(std::vector<InnerSphere> spheres) {
  std::vector<SphereGroup> groups;
  split(spheres.data(), spheres.data() + spheres.size(), &groups);
  return groups;
}

std::vector<InnerSphere> coarse_spheres(const Packing& packing, std::size_t count) {
  const std::vector<InnerSphere>& spheres = packing.spheres;
  std::vector<InnerSphere> chosen;
  if (spheres.empty()) return chosen;
  // [m] Upper bounds of how far each sphere protrudes from the chosen ones.
  std::vector<double> protrusion(spheres.size(), std::numeric_limits<double>::infinity());
  auto next = std::max_element(
      spheres.begin(), spheres.end(),
      [](const InnerSphere& a, const InnerSphere& b) { return a.radius < b.radius; });
  while (chosen.size() < std::min(count, spheres.size())) {
    chosen.push_back(*next);
    double farthest = 0.0;
    for (std::size_t i = 0; i < spheres.size(); ++i) {
      const double extent = (spheres[i].center - chosen.back().center).norm() + spheres[i].radius;
      protrusion[i] = std::min(protrusion[i], extent - chosen.back().radius);
      if (protrusion[i] > farthest) {
        farthest = protrusion[i];
        next = spheres.begin() + static_cast<std::ptrdiff_t>(i);
      }
    }
    if (farthest <= 0.0) break;  // the chosen ones contain the rest
  }
  return chosen;
}

}  // namespace ist
