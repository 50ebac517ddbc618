#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "ist_proximity/packing/packing.h"
#include "ist_proximity/tree/inner_sphere_tree.h"

namespace ist {

/// Spheres that belong together: from first to before second, in an order of indices.
using SphereRange = std::pair<std::uint32_t, std::uint32_t>;

/// The spheres of a tree, and the order that its ranges are of.
struct SphereOrder {
  const std::vector<InnerSphere>* spheres;
  std::vector<std::uint32_t> indices;

  const InnerSphere& operator[](std::uint32_t i) const { return (*spheres)[indices[i]]; }
};

inline std::uint32_t size(const SphereRange& range) { return range.second - range.first; }

/// Divides a range of more than kSphereWidth spheres into 2 to kSphereWidth groups, a node's
/// children, one after another and none empty; reorders the range. Groups of up to kSphereWidth
/// spheres become leaves. Deterministic.
/// @param levels_left  the groups' own trees may be this deep, leaves included
std::vector<SphereRange> partition(const TreeConfig& config, const SphereRange& range,
                                   int levels_left, SphereOrder* order);

/// The levels of a tree over `count` spheres that is halved at medians.
int median_levels(std::uint32_t count);

/// The three ways. The last one gives a single group where no prototypes divide the spheres.
std::vector<SphereRange> split_at_medians(const SphereRange& range, std::size_t most,
                                          SphereOrder* order);
std::vector<SphereRange> split_by_surface(const SphereRange& range, SphereOrder* order);
std::vector<SphereRange> split_by_neural_gas(const SphereRange& range, double magnification,
                                             SphereOrder* order);

}  // namespace ist
