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

/// Divides a range of more than kSphereWidth spheres into 2 to kSphereWidth groups, the children of
/// a node, and reorders the range so that they follow each other. No group is empty. Groups of up
/// to kSphereWidth spheres become leaves. Deterministic.
/// @param levels_left  the levels that the groups' subtrees may have, leaves included
std::vector<SphereRange> partition(const TreeConfig& config, const SphereRange& range,
                                   int levels_left, SphereOrder* order);

/// The levels of a tree over `count` spheres that is split at medians, leaves included.
int median_levels(std::uint32_t count);

/// The three kinds of TreeSplit. Neural gas returns a single group where its prototypes do not
/// divide the spheres.
std::vector<SphereRange> split_at_medians(const SphereRange& range, std::size_t most,
                                          SphereOrder* order);
std::vector<SphereRange> split_by_surface(const SphereRange& range, SphereOrder* order);
std::vector<SphereRange> split_by_neural_gas(const SphereRange& range, double magnification,
                                             SphereOrder* order);

}  // namespace ist
