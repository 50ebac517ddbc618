#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// A group of spheres: positions from first to before second in a SphereOrder.
using SphereRange = std::pair<std::uint32_t, std::uint32_t>;

/// The spheres of a tree, in an order that partitions change.
struct SphereOrder {
  const std::vector<InnerSphere>* spheres;
  std::vector<std::uint32_t> indices;

  const InnerSphere& operator[](std::uint32_t i) const { return (*spheres)[indices[i]]; }
};

inline std::uint32_t size(const SphereRange& range) { return range.second - range.first; }

/// Divides a range of spheres into kSphereWidth groups at most, the children of a node, and
/// reorders the range so that they follow each other: the group with the most spheres is halved at
/// the median along its longest axis until there are enough groups, or each fits a leaf. No group
/// is empty. Deterministic.
std::vector<SphereRange> split_at_medians(const SphereRange& range, SphereOrder* order);

}  // namespace ist
